"""The containers of .spz files: where the header is, and the attributes' bytes as a stream of bounded blocks.

Versions 1 to 3 are one gzip stream of a 16-byte header and the six attributes, one after the other. Version 4 is a 32-byte
header in the open, extension records, a table of (compressed, plain) sizes as two uint64 each, and one zstd stream for each
attribute that is not empty.
"""

from __future__ import annotations

import gzip
import io
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...geometry.conventions import Orientation
from ...support.words import counted

zstandard: ModuleType | None
try:
    import zstandard  # Blender's own Python has it
except ImportError:
    zstandard = None

MAGIC = b"NGSP"
GZIP_MAGIC = b"\x1f\x8b"
GZIP_WINDOW = 16 + zlib.MAX_WBITS
HEADER = struct.Struct("<4sIIBBBB")
HEADER_V4 = struct.Struct("<4sIIBBBBI12x")
TOC_ENTRY = struct.Struct("<QQ")
RECORD = struct.Struct("<II")
COORDINATES = 0xADBE0003  # the extension that declares axes other than RUB
MAX_RECORDS = 64
REST_BY_DEGREE = (0, 3, 8, 15, 24)
MAX_FRACTIONAL_BITS = 30
ANTIALIASED, HAS_EXTENSIONS = 1, 2
BLOCK_BYTES = 1 << 16  # stays in the processor's cache
# Real scans unpack to 2 to 5 times the size of their file. Thousands of times are an attack.
MAX_EXPANSION = 64
# So many bytes of payload are accepted however small the file is.
ALWAYS_ALLOWED = 16 << 20
MAX_TRAILER = 1 << 20  # bytes of extensions behind the attributes
MIN_WINDOW = 1 << 23
ORIENTATION: Orientation = "Y_UP"  # x right, y up, z back (RUB)


Source = Path | bytes


@dataclass(frozen=True)
class SpzHeader:
    """`bits` is the number of fractional bits of positions, `streams` the sizes in version 4's table, at byte `toc`."""

    version: int
    count: int
    degree: int
    bits: int
    orientation: Orientation = ORIENTATION
    declared: bool = False
    antialiased: bool = False
    toc: int = 0
    streams: tuple[tuple[int, int], ...] = ()

    @property
    def widths(self) -> tuple[int, ...]:
        """Bytes a Gaussian takes in each attribute: positions, opacities, colours, scales, rotations, SH."""
        position = 6 if self.version == 1 else 9
        return position, 1, 3, 3, 4 if self.version >= 3 else 3, 3 * REST_BY_DEGREE[self.degree]


def first_bytes(header: bytes) -> bytes:
    """Up to 16 bytes of the SPZ header in a file that begins with `header`; empty when it is no SPZ file."""
    plain = header[: HEADER.size]
    if header.startswith(GZIP_MAGIC):
        try:
            plain = zlib.decompressobj(GZIP_WINDOW).decompress(header, HEADER.size)
        except zlib.error:
            return b""
    return plain if plain.startswith(MAGIC) else b""


def opened(source: Source) -> IO[bytes]:
    """The bytes of a file, or those given, to be read."""
    return io.BytesIO(source) if isinstance(source, bytes) else open(source, "rb")


def read_spz_header(source: Source) -> SpzHeader:
    """The header, its numbers checked. Raises SplatFormatError."""
    with opened(source) as file:
        start = file.read(1 << 12)
        plain = first_bytes(start)
        if len(plain) < HEADER.size:
            raise SplatFormatError("The .spz file is cut off inside its header; copy or export it again.")
        _, version, count, degree, bits, flags, streams = HEADER.unpack(plain)
        packed = start.startswith(GZIP_MAGIC)
        if not 1 <= version <= 4:
            raise SplatFormatError(f"The .spz file is of version {version}; versions 1 to 4 can be read, so export it as one.")
        if packed == (version == 4):
            raise _other_packing(version)
        if count == 0 or degree >= len(REST_BY_DEGREE) or bits > MAX_FRACTIONAL_BITS:
            raise SplatFormatError(
                f"The .spz header has {counted(count, 'Gaussian')}, SH degree {degree} and {counted(bits, 'fractional bit')}; "
                "it is damaged."
            )
        header = SpzHeader(version, count, degree, bits, antialiased=bool(flags & ANTIALIASED))
        return _read_table(file, header, bool(flags & HAS_EXTENSIONS), streams) if version == 4 else header


def _other_packing(version: int) -> SplatFormatError:
    """What is said of a file that gzip unpacks though it should not, or does not though it should."""
    if version == 4:
        return SplatFormatError(
            "The .spz file of version 4 lies inside gzip, which belongs to versions 1 to 3; unpack it first."
        )
    return SplatFormatError(
        f"The .spz file of version {version} is not packed by gzip, as versions 1 to 3 are; pack it, or export it again."
    )


def _read_table(file: IO[bytes], header: SpzHeader, extended: bool, streams: int) -> SpzHeader:
    """`header` with what only version 4 has. Raises SplatFormatError when the table does not fit the header or the file."""
    wanted = [width * header.count for width in header.widths if width]
    file.seek(0)
    start = file.read(HEADER_V4.size)
    toc = HEADER_V4.unpack(start)[-1] if len(start) == HEADER_V4.size else 0
    size = file.seek(0, os.SEEK_END)
    if toc < HEADER_V4.size or streams != len(wanted) or toc + streams * TOC_ENTRY.size > size:
        raise SplatFormatError(f"The .spz file's table of {streams} streams does not fit its header; it is damaged.")
    declared = _declared_orientation(file, toc) if extended else None
    file.seek(toc)
    table = tuple(TOC_ENTRY.iter_unpack(file.read(streams * TOC_ENTRY.size)))
    if [plain for _, plain in table] != wanted or toc + streams * TOC_ENTRY.size + sum(packed for packed, _ in table) > size:
        raise SplatFormatError("The .spz file's streams are not as long as its header says; it is cut off or damaged.")
    return replace(header, orientation=declared or ORIENTATION, declared=declared is not None, toc=toc, streams=table)


def _declared_orientation(file: IO[bytes], end: int) -> Orientation | None:
    """What an extension record before byte `end` says of the axes; None where none does. Raises SplatFormatError."""
    at = HEADER_V4.size
    for _ in range(MAX_RECORDS):
        file.seek(at)
        if at + RECORD.size > end:
            break
        kind, length = RECORD.unpack(file.read(RECORD.size))
        if kind == COORDINATES and length == 4:
            return _orientation(int.from_bytes(file.read(4), "little"))
        at += RECORD.size + length
    return None


def _orientation(number: int) -> Orientation | None:
    """Axes as SPZ numbers them: 1 to 8 with y up or down and z front or back, 9 to 16 the same with y and z exchanged."""
    if number == 0:  # "unspecified"
        return None
    right, up, front, exchanged = (bool(number - 1 >> bit & 1) for bit in range(4))
    if number > 16 or right ^ up ^ front ^ exchanged:
        raise SplatFormatError(
            f"The .spz file declares axes number {number}, which mirror the scene or are unknown; export it with RUB axes."
        )
    if exchanged:
        return "Z_UP" if up else "Z_DOWN"
    return "Y_UP" if up else "Y_DOWN"


class Payload:
    """The attributes' bytes in their order; `blocks` is called once for each attribute."""

    def __init__(self, file: IO[bytes], header: SpzHeader) -> None:
        self._header = header
        self._file = file
        self._gzip = gzip.GzipFile(fileobj=file) if header.version < 4 else None
        if self._gzip is not None:
            self._gzip.read(HEADER.size)
        self._at = header.toc + len(header.streams) * TOC_ENTRY.size
        self._next = iter(header.streams)

    def blocks(self, width: int) -> Iterator[NDArray[np.uint8]]:
        """The next attribute as (n, width) blocks; none at all when the width is 0. The arrays are reused.

        Raises SplatFormatError where the bytes end early or are damaged.
        """
        count = self._header.count if width else 0
        stream: IO[bytes] = self._stream() if count else self._file
        rows = BLOCK_BYTES // max(width, 1)
        buffer = np.empty((min(count, rows), width), np.uint8)
        for start in range(0, count, rows):
            block = buffer[: min(rows, count - start)]
            _fill(stream, memoryview(block).cast("B"))
            yield block
        if count and self._gzip is None and stream.read(1):
            raise _damaged()

    def check_end(self) -> None:
        """Raises SplatFormatError unless the gzip stream ends soon, its checksum right."""
        left = MAX_TRAILER
        while self._gzip is not None and (got := len(self._gzip.read(BLOCK_BYTES))):
            left -= got
            if left < 0:
                raise SplatFormatError("The .spz file unpacks to more than its header promises; it is damaged.")

    def _stream(self) -> IO[bytes]:
        if self._gzip is not None:
            return self._gzip  # type: ignore[return-value]
        assert zstandard is not None
        packed, plain = next(self._next)
        self._file.seek(self._at)
        self._at += packed
        window = max(MIN_WINDOW, 1 << (plain - 1).bit_length())
        decompressor = zstandard.ZstdDecompressor(max_window_size=min(window, 1 << 31))
        stream: IO[bytes] = decompressor.stream_reader(_Part(self._file, packed), closefd=False)
        return stream


class _Part:
    """The next `length` bytes of a file, for a decompressor that must not read further."""

    def __init__(self, file: IO[bytes], length: int) -> None:
        self._file, self._left = file, length

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(min(size, self._left) if size >= 0 else self._left)
        self._left -= len(data)
        return data


@contextmanager
def open_payload(source: Source, header: SpzHeader) -> Iterator[Payload]:
    """The attributes of a file, or of its bytes, which are unpacked once, while they are read. Whoever reads them believes the
    header's count only once the first attribute has come, and asks `check_end` at the end.

    Raises SplatFormatError when they are cut off, damaged, or suspiciously many for the file's size.
    """
    if header.version == 4 and zstandard is None:
        raise SplatFormatError("The .spz file is of version 4, which needs Python's zstandard module; export it as version 3.")
    size = len(source) if isinstance(source, bytes) else source.stat().st_size
    need = header.count * sum(header.widths)
    if need > max(MAX_EXPANSION * size, ALWAYS_ALLOWED):
        raise SplatFormatError(
            f"The .spz file promises {counted(header.count, 'Gaussian')} in {counted(size, 'byte')}, too many to be "
            "a scan; it is damaged."
        )
    errors = (EOFError, zlib.error, gzip.BadGzipFile, *((zstandard.ZstdError,) if zstandard is not None else ()))
    with opened(source) as file:
        try:
            yield Payload(file, header)
        except errors:
            raise _damaged() from None


def _fill(stream: IO[bytes], view: memoryview) -> None:
    at = 0
    while at < len(view):
        got = stream.readinto(view[at:])  # type: ignore[attr-defined]
        if not got:
            raise _damaged()
        at += got


def _damaged() -> SplatFormatError:
    return SplatFormatError("The .spz file is cut off or damaged inside its Gaussians; copy or export it again.")
