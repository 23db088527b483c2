"""The compressed .ply of SuperSplat and PlayCanvas: chunks of 256 Gaussians, quantised between each chunk's bounds.

Element `chunk`: min and max of position, of log scale and, in newer files, of colour. Element `vertex`: four uint32 a
Gaussian, `packed_position` and `packed_scale` with 11, 10, 11 bits for x, y, z, `packed_rotation` with 2 bits for the
largest of w x y z and 10 for each of the others, `packed_color` with 8 bits for r, g, b and opacity. Element `sh`, where
there is one: f_rest_* as uint8 over -4..4. Binary only. The writer is in ply_compressed_write.py.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...support.words import counted
from ..activate import SH_C0, SceneBuilder
from ..format import Progress, SplatFormat, SplatInfo
from ..scene import SH_COEFFICIENTS, Float32Array, GaussianScene
from .header import PlyElement, PlyHeader, read_header
from .layout import ORIENTATION, header_names, rest_names

NAME = "compressed ply"
CHUNK = 256
BLOCK = 32 * CHUNK
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
POSITION_BOUNDS = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
SCALE_BOUNDS = tuple(f"{end}_scale_{axis}" for end in ("min", "max") for axis in "xyz")
COLOUR_BOUNDS = ("min_r", "min_g", "min_b", "max_r", "max_g", "max_b")
SH_RANGE = 8.0
# For each index of the largest component: where w x y z stand among the largest one, a, b and c.
LARGEST_FIRST = np.array([[0, 1, 2, 3], [1, 0, 2, 3], [1, 2, 0, 3], [1, 2, 3, 0]])


@dataclass(frozen=True)
class _Plan:
    """A header that was checked: `bounds` names the chunk's columns, `rest` the SH columns, `at` each element's first byte."""

    header: PlyHeader
    count: int
    bounds: tuple[str, ...]
    rest: tuple[str, ...]
    at: dict[str, int]
    end: int

    def row_type(self, element: str) -> np.dtype[np.void]:
        """The data type of one row of the element as it lies in the file."""
        found = self.header.element(element)
        assert found is not None
        return np.dtype([(p.name, self.header.byte_order + p.type) for p in found.properties])


def detect(header: bytes) -> bool:
    """Whether these first bytes are of a .ply with packed positions."""
    return "packed_position" in header_names(header)


def inspect(path: str | Path) -> SplatInfo:
    """What the header says. Raises SplatFormatError."""
    with open(path, "rb") as file:
        plan = _plan(read_header(file))
    return SplatInfo(NAME, plan.count, SH_COEFFICIENTS.index(len(plan.rest) // 3 + 1), ORIENTATION)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Gaussians of chunks whose bounds are not finite are left out and counted. Raises SplatFormatError, and OSError.
    """
    with open(path, "rb") as file:
        plan = _plan(read_header(file))
        size = os.fstat(file.fileno()).st_size
        if size < plan.end:
            raise SplatFormatError(
                f"The compressed .ply is cut off: its header promises {plan.end} bytes and it has {size}; export it again."
            )
        chunks = _table(_rows(file, plan, "chunk", range(math.ceil(plan.count / CHUNK))), plan.bounds)
        builder = SceneBuilder(plan.count, len(plan.rest) // 3 + 1)
        for start in range(0, plan.count, BLOCK):
            rows = range(start, min(start + BLOCK, plan.count))
            _decode(file, plan, chunks, rows, builder)
            if progress is not None:
                progress(rows.stop / plan.count)
    return builder.scene(NAME, ORIENTATION)


def _decode(file: IO[bytes], plan: _Plan, chunks: Float32Array, rows: range, builder: SceneBuilder) -> None:
    """Reads the Gaussians `rows` and adds them to the builder; `chunks` holds the bounds of every chunk of the file."""
    vertex = _rows(file, plan, "vertex", rows)
    position, rotation, scale, color = (vertex[name].astype(np.uint32) for name in PACKED)
    bounds = chunks[np.arange(rows.start, rows.stop) // CHUNK]
    rgba = _fields(color, (8, 8, 8, 8))
    sh = np.empty((len(rows), len(plan.rest) // 3 + 1, 3), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        means = _between(bounds[:, 0:6], _fields(position, (11, 10, 11)))
        scales = np.exp(_between(bounds[:, 6:12], _fields(scale, (11, 10, 11))))
        rgb = _between(bounds[:, 12:18], rgba[:, :3]) if len(plan.bounds) == 18 else rgba[:, :3]
        sh[:, 0] = (rgb - 0.5) / SH_C0
        if plan.rest:
            codes = _table(_rows(file, plan, "sh", rows), plan.rest)
            sh[:, 1:] = _unpack_sh(codes).reshape(len(sh), 3, -1).transpose(0, 2, 1)
    builder.add_activated(means, scales, _unpack_rotation(rotation), rgba[:, 3], sh)


def _fields(packed: NDArray[np.uint32], bits: Sequence[int]) -> Float32Array:
    """(n, len(bits)) fractions 0..1, the first field in the highest bits."""
    out = np.empty((len(packed), len(bits)), np.float32)
    shift = sum(bits)
    for column, width in enumerate(bits):
        shift -= width
        full = (1 << width) - 1
        out[:, column] = (packed >> shift & full) / full
    return out


def _between(bounds: Float32Array, fraction: Float32Array) -> Float32Array:
    """Fractions 0..1 (n, 3) to values between `bounds` (n, 6), 3 minima and 3 maxima."""
    return np.asarray(bounds[:, :3] * (1 - fraction) + bounds[:, 3:] * fraction)


def _unpack_rotation(packed: NDArray[np.uint32]) -> Float32Array:
    """Quaternions w x y z (n, 4); the three stored ones lie within +-sqrt(1/2)."""
    parts = np.empty((len(packed), 4), np.float32)
    parts[:, 1:] = (_fields(packed, (10, 10, 10)) - 0.5) * math.sqrt(2)
    parts[:, 0] = np.sqrt(np.maximum(0, 1 - (parts[:, 1:] ** 2).sum(axis=1)))
    return np.take_along_axis(parts, LARGEST_FIRST[packed >> 30], axis=1)


def _unpack_sh(codes: Float32Array) -> Float32Array:
    """Bytes to coefficients: the middle of each 256th of the range, but its ends for 0 and 255."""
    middle = (codes + 0.5) / 256
    return np.asarray((np.where(codes == 0, 0, np.where(codes == 255, 1, middle)) - 0.5) * SH_RANGE, np.float32)


def _rows(file: IO[bytes], plan: _Plan, element: str, rows: range) -> NDArray[np.void]:
    """The rows of an element of the file, as a structured array."""
    row = plan.row_type(element)
    file.seek(plan.at[element] + rows.start * row.itemsize)
    return np.frombuffer(file.read(len(rows) * row.itemsize), row)


def _table(rows: NDArray[np.void], names: Sequence[str]) -> Float32Array:
    out = np.empty((len(rows), len(names)), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for column, name in enumerate(names):
            out[:, column] = rows[name]
    return out


def _plan(header: PlyHeader) -> _Plan:
    """Where everything is. Raises SplatFormatError when the header is not one of this layout."""
    if not header.byte_order:
        raise SplatFormatError("The compressed .ply is an ascii file, which nobody writes; export it as binary.")
    chunk, vertex, sh = (header.element(name) for name in ("chunk", "vertex", "sh"))
    if chunk is None or vertex is None or vertex.count == 0:
        raise SplatFormatError("The compressed .ply has no element 'chunk' or no Gaussians; export the scan again.")
    _need(vertex, PACKED, "u4")
    colours = any(p.name in COLOUR_BOUNDS for p in chunk.properties)
    bounds = (*POSITION_BOUNDS, *SCALE_BOUNDS, *(COLOUR_BOUNDS if colours else ()))
    _need(chunk, bounds, "f")
    if chunk.count * CHUNK < vertex.count:
        raise SplatFormatError(
            f"The compressed .ply has {counted(chunk.count, 'chunk')}, too few for "
            f"{counted(vertex.count, 'Gaussian')}; export the scan again."
        )
    rest: tuple[str, ...] = ()
    if sh is not None:
        rest = tuple(rest_names([p.name for p in sh.properties]))
        _need(sh, rest, "u1")
        if sh.count != vertex.count:
            raise SplatFormatError(
                f"The compressed .ply has SH for {sh.count} of {counted(vertex.count, 'Gaussian')}; export the scan again."
            )
    at, end = _places(header)
    return _Plan(header, vertex.count, bounds, rest, at, end)


def _places(header: PlyHeader) -> tuple[dict[str, int], int]:
    """Each element's first byte, and the end of the last. Raises SplatFormatError on lists and on names given twice."""
    at, end = {}, header.size
    for element in header.elements:
        names = {p.name for p in element.properties}
        if element.has_lists or len(names) < len(element.properties) or element.name in at:
            raise SplatFormatError(
                f"The element '{element.name[:40]}' of the compressed .ply has lists or names given twice; export it again."
            )
        at[element.name] = end
        end += element.count * sum(np.dtype(p.type).itemsize for p in element.properties)
    return at, end


def _need(element: PlyElement, names: Sequence[str], kind: str) -> None:
    """Raises SplatFormatError unless the element has these properties, of a type that begins with `kind`."""
    types = {p.name: p.type for p in element.properties}
    wrong = [name for name in names if not types.get(name, "").startswith(kind)]
    if wrong:
        raise SplatFormatError(
            f"The compressed .ply's element '{element.name}' lacks {', '.join(wrong)}, or its type is another; export it again."
        )


FORMAT = SplatFormat(NAME, ".ply", ORIENTATION, detect, inspect, read)
