"""Messages between us and a process of ours: one JSON line, then the bytes of the arrays it announces.

No pickle: a network that has taken over its process must not get further than wrong numbers. Nor would it work from inside
Blender, where our modules have other names than in the process.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from io import BufferedIOBase
from typing import Any

import numpy as np
from numpy.typing import NDArray

DTYPES = frozenset({"<f4", "<f8", "|u1", "<i8"})
MAX_LINE_BYTES = 1 << 20
MAX_ARRAYS = 8
MAX_ARRAY_BYTES = 1 << 30

Header = dict[str, Any]
Arrays = list[NDArray[Any]]


class WireError(Exception):
    """What came is no message."""


def send(stream: BufferedIOBase, header: Header, arrays: Sequence[NDArray[Any]] = ()) -> None:
    """Write one message. Raises OSError or ValueError when the other side is gone."""
    plain = [np.ascontiguousarray(a, a.dtype.newbyteorder("<")) for a in arrays]
    shapes = [[a.dtype.str, list(a.shape)] for a in plain]
    stream.write(json.dumps({**header, "arrays": shapes}).encode() + b"\n")
    for array in plain:
        stream.write(array.reshape(-1).view(np.uint8).data)
    stream.flush()


def receive(stream: BufferedIOBase) -> tuple[Header, Arrays] | None:
    """One message as it was sent; None when the other side has ended. Raises WireError for anything else."""
    line = stream.readline(MAX_LINE_BYTES)
    if not line:
        return None
    try:
        header = json.loads(line)
        shapes = [(str(kind), tuple(int(n) for n in shape)) for kind, shape in header.pop("arrays")]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise WireError("no header") from None
    if len(shapes) > MAX_ARRAYS:
        raise WireError("too many arrays")
    return header, [_array(stream, kind, shape) for kind, shape in shapes]


def _array(stream: BufferedIOBase, kind: str, shape: tuple[int, ...]) -> NDArray[Any]:
    if kind not in DTYPES or len(shape) > 3 or any(n < 0 for n in shape):
        raise WireError("no array")
    size = np.dtype(kind).itemsize
    for n in shape:
        size *= n
    if size > MAX_ARRAY_BYTES:
        raise WireError("too large an array")
    data = np.empty(size, np.uint8)
    if size and stream.readinto(data) != size:
        raise WireError("cut short")
    return data.view(kind).reshape(shape)
