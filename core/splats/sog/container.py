"""The files of a SOG scene: meta.json and pictures whose pixels are numbers, in a ZIP archive or beside each other.

What the files claim about their sizes is checked before anything is unpacked.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...support.quiet import quiet_opencv

Bytes = NDArray[np.uint8]

META, STREAMED = "meta.json", "lod-meta.json"
ZIP_MAGIC = b"PK\x03\x04"
LARGEST_FILE, LARGEST_META = 1 << 30, 64 << 20
LARGEST_PICTURE = 1 << 28  # pixels
FAULTS = (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, ValueError)


class SogFiles:
    """The files of a scene by their names in meta.json; `content` gives the bytes of one, at most so many."""

    def __init__(self, content: Callable[[str, int], bytes]) -> None:
        self._content = content

    def meta(self) -> dict[str, Any]:
        """What meta.json holds. Raises SplatFormatError where it is no JSON object."""
        try:
            meta = json.loads(self._content(META, LARGEST_META).decode("utf-8-sig"))
        except (ValueError, RecursionError):
            meta = None
        if not isinstance(meta, dict):
            raise SplatFormatError(f"The {META} of the SOG scene is no valid JSON; export the scene again.")
        return meta

    def pixels(self, name: Any, at_least: int) -> Bytes:
        """The pixels (N, 4) of a picture, red green blue alpha, row by row from the top; N >= `at_least`."""
        return self.picture(name, at_least).reshape(-1, 4)

    def picture(self, name: Any, at_least: int) -> Bytes:
        """As `pixels`, as a picture (H, W, 4)."""
        if not isinstance(name, str) or not name or "/" in name or "\\" in name:
            raise SplatFormatError(f"The {META} of the SOG scene names its pictures wrongly; export the scene again.")
        data = self._content(name, LARGEST_FILE)
        size = _size(data)
        if size is None or not at_least <= size[0] * size[1] <= LARGEST_PICTURE:
            raise SplatFormatError(f"The picture '{name}' of the SOG scene is damaged or too small; export the scene again.")
        try:
            with quiet_opencv():
                raw: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            raw = None
        if raw is None or raw.dtype != np.uint8 or raw.shape[:2] != size[::-1]:
            raise SplatFormatError(f"The picture '{name}' of the SOG scene cannot be decoded; export the scene again.")
        raw = raw.reshape(*raw.shape[:2], -1)
        if raw.shape[2] < 3:
            raw = np.repeat(raw[..., :1], 3, axis=2)
        alpha = raw[..., 3:4] if raw.shape[2] > 3 else np.full_like(raw[..., :1], 255)
        return np.concatenate([raw[..., 2::-1], alpha], axis=2)


@contextmanager
def open_files(path: Path) -> Iterator[SogFiles]:
    """The files of the scene at `path`: an archive, a folder, or the meta.json in one. Raises SplatFormatError, and OSError."""
    if path.is_dir() or not _is_archive(path):
        folder = path if path.is_dir() else path.parent
        names = {META: path.name if path.is_file() else META}
        yield SogFiles(lambda name, most: _read(folder / names.get(name, name), most))
        return
    try:
        with zipfile.ZipFile(path) as archive:
            yield SogFiles(lambda name, most: _unpack(archive, name, most))
    except FAULTS:
        raise SplatFormatError("The archive is no .sog scene, or is cut off or damaged; copy or export it again.") from None


def _is_archive(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(ZIP_MAGIC)) == ZIP_MAGIC


def _read(file: Path, most: int) -> bytes:
    if not file.is_file():
        raise SplatFormatError(f"The SOG scene lacks its file '{file.name}'; copy the whole folder.")
    if file.stat().st_size > most:
        raise SplatFormatError(f"The file '{file.name}' of the SOG scene is too large to be one; export the scene again.")
    return file.read_bytes()


def _unpack(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    # Some programs put the files into a folder inside the archive.
    found = next((one for one in archive.infolist() if one.filename.rsplit("/", 1)[-1] == name), None)
    if found is None:
        raise SplatFormatError(f"The archive holds no '{name}', so it is no SOG scene, or a damaged one; export it again.")
    if found.file_size > most:
        raise SplatFormatError(f"The file '{name}' of the SOG scene is too large to be one; export the scene again.")
    return archive.read(found)


def _size(data: bytes) -> tuple[int, int] | None:
    """(width, height) of a WebP (lossless, lossy or extended) or PNG; None of anything else."""
    if data[:8] == b"\x89PNG\r\n\x1a\n" and len(data) >= 24:
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP" or len(data) < 30:
        return None
    if data[12:16] == b"VP8L":
        bits = int.from_bytes(data[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if data[12:16] == b"VP8X":
        return 1 + int.from_bytes(data[24:27], "little"), 1 + int.from_bytes(data[27:30], "little")
    return int.from_bytes(data[26:28], "little") & 0x3FFF, int.from_bytes(data[28:30], "little") & 0x3FFF
