"""Which scan a file holds, told without reading all of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..errors import SplatFormatError
from . import scan_files

# Of a scan, which may have gigabytes.
BLOCKS, BLOCK_BYTES = 64, 1 << 16


def scan_file_digest(path: Path, dated: bool = True) -> str:
    """Digest of a scan: of each of its files the size, the time of its last change (where `dated`: it is another one for a copy
    of the file), and BLOCKS blocks spread over its content, both ends among them. Raises SplatFormatError when it cannot be
    read.

    A map of the scan is kept under `locate.scan_digest`, of the Gaussians themselves, because Blender has them without a file.
    This one takes some milliseconds whatever the scan's size, where that one needs the whole scan read first: a batch that is
    finished, or whose photos all have starts, need not read it at all in its own process.
    """
    digest = hashlib.sha256()
    try:
        for one in scan_files(path):
            with one.open("rb") as file:
                state = one.stat()
                digest.update(f"{state.st_size} {state.st_mtime_ns if dated else ''}".encode())
                for k in range(BLOCKS):
                    file.seek(max(0, state.st_size - BLOCK_BYTES) * k // (BLOCKS - 1))
                    digest.update(file.read(BLOCK_BYTES))
    except OSError as error:
        raise SplatFormatError(f"The splat file '{path}' cannot be read ({error.strerror}); check the path.") from error
    return digest.hexdigest()
