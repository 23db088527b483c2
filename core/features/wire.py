"""Messages between us and the process that runs foreign networks: one JSON line, then the bytes of the arrays it announces.

No pickle: a network that has taken over its process must not get further than wrong numbers.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .types import Features, Matches

DTYPES = frozenset({"<f4", "<f8", "|u1", "<i8"})
MAX_LINE_BYTES = 65_536
MAX_ARRAYS = 8
MAX_ARRAY_BYTES = 1 << 30

Header = dict[str, Any]
Arrays = list[NDArray[Any]]


class WireError(Exception):
    """What came is no message."""


def send(stream: IO[bytes], header: Header, arrays: Sequence[NDArray[Any]] = ()) -> None:
    """Write one message. Raises OSError or ValueError when the other side is gone."""
    plain = [np.ascontiguousarray(a, a.dtype.newbyteorder("<")) for a in arrays]
    shapes = [[a.dtype.str, list(a.shape)] for a in plain]
    stream.write(json.dumps({**header, "arrays": shapes}).encode() + b"\n")
    for array in plain:
        stream.write(array.tobytes())
    stream.flush()


def receive(stream: IO[bytes]) -> tuple[Header, Arrays] | None:
    """One message; None when the other side has ended. Raises WireError for anything else."""
    line = stream.readline(MAX_LINE_BYTES)
    if not line:
        return None
    try:
        header = json.loads(line)
        shapes = [(str(kind), tuple(int(n) for n in shape)) for kind, shape in header["arrays"]]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise WireError("no header") from None
    if len(shapes) > MAX_ARRAYS:
        raise WireError("too many arrays")
    return header, [_array(stream, kind, shape) for kind, shape in shapes]


def _array(stream: IO[bytes], kind: str, shape: tuple[int, ...]) -> NDArray[Any]:
    if kind not in DTYPES or len(shape) > 3 or any(n < 0 for n in shape):
        raise WireError("no array")
    size = np.dtype(kind).itemsize
    for n in shape:
        size *= n
    if size > MAX_ARRAY_BYTES:
        raise WireError("too large an array")
    data = stream.read(size)
    if len(data) != size:
        raise WireError("cut short")
    return np.frombuffer(data, kind).reshape(shape)


def pack_features(features: Features) -> tuple[Header, Arrays]:
    return {"size": list(features.size)}, [features.keypoints, features.descriptors]


def unpack_features(header: Header, arrays: Arrays) -> Features:
    """Raises WireError when the arrays are not those of features."""
    try:
        width, height = (int(n) for n in header["size"])
        points, rows = arrays
    except (KeyError, TypeError, ValueError):
        raise WireError("no features") from None
    if points.ndim != 2 or points.shape[1] != 2 or rows.ndim != 2 or len(rows) != len(points) or points.dtype != np.float64:
        raise WireError("no features")
    if rows.dtype not in (np.float32, np.uint8) or not np.isfinite(points).all() or not np.isfinite(rows).all():
        raise WireError("no features")
    return Features(points, rows, (width, height))


def unpack_matches(arrays: Arrays, count_a: int, count_b: int) -> Matches:
    """Raises WireError when the arrays are no matches between so many features."""
    if len(arrays) != 2 or arrays[0].dtype != np.int64 or arrays[0].ndim != 2 or arrays[0].shape[1:] != (2,):
        raise WireError("no matches")
    indices, similarity = arrays[0].astype(np.intp), arrays[1].astype(np.float32)
    if similarity.shape != (len(indices),) or (indices < 0).any() or (indices >= (count_a, count_b)).any():
        raise WireError("no matches")
    return Matches(indices, similarity)
