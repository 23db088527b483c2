"""The body of a PLY file: the vertex element's wanted columns, in chunks of bounded memory, whatever their order or type."""

from __future__ import annotations

import itertools
import os
import warnings
from collections.abc import Iterator, Sequence
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ..scene import Float32Array
from .header import PlyElement, PlyHeader

# A chunk and its columns stay in the processor's cache while they are transposed.
CHUNK_BYTES = 1 << 20
ASCII_CHUNK_ROWS = 4096
# From here on float32 rounds to more than a ten-thousandth of a unit.
FAR = 1024.0


def rows_at_most(file: IO[bytes], header: PlyHeader, vertex: PlyElement) -> int:
    """Upper bound of vertex rows that the rest of `file` can hold, so that a false count never sizes an array."""
    left = os.fstat(file.fileno()).st_size - file.tell()
    if header.byte_order:
        return min(vertex.count, left // _row_type(header, vertex).itemsize)
    return min(vertex.count, (left + 1) // (2 * len(vertex.properties)))  # a digit and a separator for each value


class FarOrigin:
    """What is subtracted from the first three columns, x y z, of a file with more digits than float32 has: whole numbers near
    the middle of its first chunk where that lies far out, else zero.
    """

    def __init__(self) -> None:
        self.origin = np.zeros(3)
        self._found = False

    def subtract(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """xyz (n, 3) less the origin."""
        if not self._found and len(xyz):
            self._found = True
            finite = xyz[np.isfinite(xyz).all(axis=1)]
            middle = np.rint(np.median(finite, axis=0)) if len(finite) else np.zeros(3)
            self.origin = middle if np.abs(middle).max() > FAR else np.zeros(3)
        return xyz - self.origin


def vertex_columns(
    file: IO[bytes], header: PlyHeader, names: Sequence[str], far: FarOrigin | None = None
) -> Iterator[Float32Array]:
    """Chunks (n, len(names)) of the vertex element's columns `names`, float32, in the file's row order.

    `file` stands at the first vertex row. The arrays may be reused between chunks. Fewer rows than promised end the
    iteration early; the caller counts. `far`: the first three columns are x y z, and less its origin where the file has more
    digits than float32. Raises SplatFormatError on text that is not numbers.
    """
    vertex = header.element("vertex")
    assert vertex is not None
    order = [p.name for p in vertex.properties]
    columns = [order.index(name) for name in names]
    if header.byte_order:
        row, most = _row_type(header, vertex), rows_at_most(file, header, vertex)
        exact = far is not None and all(vertex.properties[column].type == "f8" for column in columns[:3])
        return _binary_chunks(file, row, most, columns, far if exact else None)
    return (_near(values, far) for values in _ascii_chunks(file, vertex.count, len(order), columns))


def _near(values: NDArray[np.float64], far: FarOrigin | None) -> Float32Array:
    if far is not None:
        values[:, :3] = far.subtract(values[:, :3])
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def skip_elements_before_vertex(file: IO[bytes], header: PlyHeader) -> None:
    """Move `file` from the body's start to the first vertex row. Raises SplatFormatError when the file ends before it."""
    for element in itertools.takewhile(lambda e: e.name != "vertex", header.elements):
        if not header.byte_order:
            if sum(1 for _ in itertools.islice(file, element.count)) < element.count:
                raise _ends_in(element)
        elif element.has_lists:
            _skip_lists(file, header.byte_order, element)
        else:
            size = _row_type(header, element).itemsize * element.count
            if file.tell() + size > os.fstat(file.fileno()).st_size:
                raise _ends_in(element)
            file.seek(size, os.SEEK_CUR)


def _ends_in(element: PlyElement) -> SplatFormatError:
    return SplatFormatError(
        f"The PLY file ends inside its element '{element.name}'; it is cut off, so copy or export it again."
    )


def _row_type(header: PlyHeader, element: PlyElement) -> np.dtype[np.void]:
    return np.dtype([(f"c{i}", header.byte_order + p.type) for i, p in enumerate(element.properties)])


def _skip_lists(file: IO[bytes], byte_order: str, element: PlyElement) -> None:
    end = os.fstat(file.fileno()).st_size
    types = [
        (np.dtype(byte_order + (p.count_type or p.type)), np.dtype(p.type).itemsize, p.count_type) for p in element.properties
    ]
    for _ in range(element.count):
        for head, item_size, count_type in types:
            raw = file.read(head.itemsize)
            if len(raw) < head.itemsize:
                raise _ends_in(element)
            if count_type:
                length = int(np.frombuffer(raw, head)[0])
                if length < 0 or file.tell() + length * item_size > end:
                    raise _ends_in(element)
                file.seek(length * item_size, os.SEEK_CUR)


def _binary_chunks(
    file: IO[bytes], row: np.dtype[np.void], count: int, columns: list[int], far: FarOrigin | None
) -> Iterator[Float32Array]:
    step = max(1, min(count, CHUNK_BYTES // row.itemsize))
    buffer = np.empty(step * row.itemsize, np.uint8)
    out = np.empty((step, len(columns)), np.float32)
    fields = [field[0] for field in (row.fields or {}).values()]
    alike = len(set(fields)) == 1
    for start in range(0, count, step):
        n = min(step, count - start)
        got = file.readinto(memoryview(buffer)[: n * row.itemsize]) // row.itemsize  # type: ignore[attr-defined]
        raw = buffer[: got * row.itemsize]
        if alike:
            out[:got] = raw.view(fields[0]).reshape(got, len(fields))[:, columns]
        else:
            records = raw.view(row)
            for j, column in enumerate(columns):
                out[:got, j] = records[f"c{column}"]
        if far is not None:
            out[:got, :3] = far.subtract(np.stack([raw.view(row)[f"c{column}"] for column in columns[:3]], axis=1))
        yield out[:got]


def _ascii_chunks(file: IO[bytes], count: int, width: int, columns: list[int]) -> Iterator[NDArray[np.float64]]:
    lines = itertools.islice((line for line in file if not line.isspace()), count)
    done = 0
    while chunk := list(itertools.islice(lines, ASCII_CHUNK_ROWS)):
        try:
            values = _parse(chunk, columns, width)
        except ValueError:
            raise SplatFormatError(
                f"The ascii PLY does not hold {width} numbers per line near vertex {done}; it is damaged, so export it again."
            ) from None
        yield values
        done += len(chunk)


def _parse(lines: list[bytes], columns: list[int], width: int) -> NDArray[np.float64]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values: NDArray[np.float64] = np.loadtxt(lines, np.float64, comments=None, ndmin=2, encoding="latin-1")
    if values.shape != (len(lines), width):
        raise ValueError("rows of another width")
    return values[:, columns]
