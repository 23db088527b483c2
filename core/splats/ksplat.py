"""The .ksplat of GaussianSplats3D (mkkellogg): levels 0, 1 and 2, SH degrees 0 to 2.

A header of 4096 bytes, one of 1024 bytes for each section that there is room for, then the sections: how many Gaussians the
buckets that are not full have (uint32), the buckets' centres (3 float32), and the Gaussians. Of each: position, scale (linear),
quaternion w x y z, colour and opacity (4 bytes), SH above degree 0. Level 0 has float32 throughout. Levels 1 and 2 have
positions of 16 bits within the cube of a bucket and half floats for the rest, but level 2 SH bytes over a range in the header.
SH values lie degree by degree, and there channel by channel. Axes as in the .ply that the file was made from: y down.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..errors import SplatFormatError
from ..geometry.conventions import Orientation
from .activate import SH_C0, SceneBuilder
from .format import Progress, SplatFormat, SplatInfo
from .scene import SH_COEFFICIENTS, Float32Array, GaussianScene

NAME = "ksplat"
ORIENTATION: Orientation = "Y_DOWN"
HEADER_BYTES, SECTION_BYTES = 4096, 1024
HEADER = struct.Struct("<BB2xIIIIH2x3fff")
SECTION = struct.Struct("<IIIIfH2xI4xIIH")
CHUNK_ROWS = 1 << 15
HALF_RANGE = 32767  # of positions, where a section tells none
SH_RANGE = (-1.5, 1.5)  # likewise of the SH of level 2
MAX_DEGREE = 2
BUCKET_BYTES = 12


@dataclass(frozen=True)
class _Header:
    """`level` of compression, sections in use and of which there is room, Gaussians, and the range of SH bytes."""

    level: int
    sections: int
    room: int
    count: int
    sh_range: tuple[float, float]


@dataclass(frozen=True)
class _Section:
    """`count` Gaussians from byte `start` on, behind `buckets` of `size` each, of which `full` are full and `partial` not."""

    count: int
    start: int
    size: int
    buckets: int
    full: int
    partial: int
    step: float
    half_range: int
    degree: int


def detect(header: bytes) -> bool:
    """Whether these first bytes are of a header: version 0.1, a known level, and nothing where nothing is stored."""
    if len(header) < HEADER_BYTES or header[:2] != b"\0\1":
        return False
    _, _, room, sections, _, count, level, *_ = HEADER.unpack_from(header)
    return level <= 2 and 0 < sections <= room and count > 0 and not any(header[64:HEADER_BYTES])


def inspect(path: str | Path) -> SplatInfo:
    """What the headers say. Raises SplatFormatError."""
    with open(path, "rb") as file:
        header, sections = _read_headers(file)
    return SplatInfo(f"{NAME} level {header.level}", header.count, max(one.degree for one in sections), ORIENTATION)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Raises SplatFormatError, and OSError from the file system.
    """
    with open(path, "rb") as file:
        header, sections = _read_headers(file)
        builder = SceneBuilder(header.count, SH_COEFFICIENTS[max(one.degree for one in sections)])
        for section in sections:
            _read_section(file, header, section, builder, progress)
    return builder.scene(f"{NAME} level {header.level}", ORIENTATION)


def _record(level: int, degree: int) -> np.dtype[np.void]:
    """A Gaussian as it lies in the file."""
    rest = 3 * (SH_COEFFICIENTS[degree] - 1)
    number, place, value = ("<f4", "<f4", "<f4") if level == 0 else ("<f2", "<u2", "<f2" if level == 1 else "u1")
    return np.dtype([("mean", place, 3), ("scale", number, 3), ("rotation", number, 4), ("rgba", "u1", 4), ("sh", value, rest)])


def _read_headers(file: IO[bytes]) -> tuple[_Header, list[_Section]]:
    """The file's header and those of its sections, all within the file. Raises SplatFormatError."""
    data = file.read(HEADER_BYTES)
    if len(data) < HEADER_BYTES:
        raise _damaged()
    _, _, room, sections, _, count, level, _, _, _, low, high = HEADER.unpack_from(data)
    size = os.fstat(file.fileno()).st_size
    if not 0 < sections <= room <= size // SECTION_BYTES or level > 2:
        raise _damaged()
    header = _Header(level, sections, room, count, (low, high) if low or high else SH_RANGE)
    found, at = [], HEADER_BYTES + room * SECTION_BYTES
    table = file.read(sections * SECTION_BYTES)
    if len(table) < sections * SECTION_BYTES:
        raise _damaged()
    for number in range(sections):
        section, at = _section(table, number * SECTION_BYTES, level, at)
        found.append(section)
    # The last section may have room that is left out of the file.
    last = found[-1]
    end = last.start + last.count * _record(level, last.degree).itemsize
    if end > size or sum(one.count for one in found) != count or not count:
        raise _damaged()
    return header, found


def _section(table: bytes, offset: int, level: int, at: int) -> tuple[_Section, int]:
    """The section whose header is at `offset` and whose bytes begin at `at`, and where they end. Raises SplatFormatError."""
    count, most, size, buckets, block, width, half_range, full, partial, degree = SECTION.unpack_from(table, offset)
    sound = count <= most and degree <= MAX_DEGREE and np.isfinite(block) and full + partial <= buckets
    if level:
        sound = sound and width == BUCKET_BYTES and full * size <= count <= full * size + partial * size
    if not sound:
        raise _damaged()
    half_range = half_range or HALF_RANGE
    start = at + 4 * partial + width * buckets
    section = _Section(count, start, size, buckets, full, partial, block / 2 / half_range, half_range, degree)
    return section, start + most * _record(level, degree).itemsize


def _read_section(
    file: IO[bytes], header: _Header, section: _Section, builder: SceneBuilder, progress: Progress | None
) -> None:
    """Adds the Gaussians of a section. Raises SplatFormatError."""
    record = _record(header.level, section.degree)
    ends, centres = _buckets(file, section) if header.level else (np.zeros(0), np.zeros((0, 3), np.float32))
    file.seek(section.start)
    for first in range(0, section.count, CHUNK_ROWS):
        count = min(CHUNK_ROWS, section.count - first)
        data = file.read(count * record.itemsize)
        if len(data) < count * record.itemsize:
            raise _damaged()
        rows = np.frombuffer(data, record)
        means = rows["mean"]
        if header.level:
            bucket = np.searchsorted(ends, np.arange(first, first + count), side="right")
            means = (means.astype(np.float32) - section.half_range) * np.float32(section.step) + centres[bucket]
        rgba = rows["rgba"].astype(np.float32) / np.float32(255)
        sh = np.zeros((count, builder.coefficients, 3), np.float32)
        sh[:, 0] = (rgba[:, :3] - 0.5) / SH_C0
        _fill_rest(sh, rows["sh"], header, section.degree)
        parts = (means, rows["scale"].astype(np.float32), rows["rotation"].astype(np.float32), rgba[:, 3])
        builder.add_activated(*parts, sh)
        if progress is not None:
            progress(builder.filled / header.count)


def _buckets(file: IO[bytes], section: _Section) -> tuple[NDArray[np.int64], Float32Array]:
    """Up to which Gaussian each bucket reaches (n,), and its centre (n, 3). Raises SplatFormatError."""
    file.seek(section.start - 4 * section.partial - BUCKET_BYTES * section.buckets)
    data = file.read(4 * section.partial + BUCKET_BYTES * section.buckets)
    if len(data) < 4 * section.partial + BUCKET_BYTES * section.buckets:
        raise _damaged()
    lengths = np.full(section.full + section.partial, section.size, np.int64)
    lengths[section.full :] = np.frombuffer(data, "<u4", section.partial)
    ends = np.cumsum(lengths)
    centres = np.frombuffer(data, "<f4", 3 * section.buckets, 4 * section.partial).reshape(-1, 3)
    if section.count and (not len(ends) or ends[-1] < section.count):
        raise _damaged()
    return ends, centres


def _fill_rest(sh: Float32Array, raw: NDArray[np.generic], header: _Header, degree: int) -> None:
    """The SH above degree 0 of `raw` (n, 3 K - 3) into `sh`."""
    values = raw.astype(np.float32)
    if header.level == 2:
        low, high = header.sh_range
        values = np.float32(low) + values * np.float32((high - low) / 255)
    at = 0
    for band in range(1, degree + 1):
        width = 2 * band + 1
        sh[:, band**2 : band**2 + width] = values[:, at : at + 3 * width].reshape(-1, 3, width).transpose(0, 2, 1)
        at += 3 * width


def _damaged() -> SplatFormatError:
    return SplatFormatError("The .ksplat file is cut off or damaged; copy or export it again.")


FORMAT = SplatFormat(NAME, ".ksplat", ORIENTATION, detect, inspect, read)
