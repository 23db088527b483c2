"""Features and matches as messages between us and the process that runs foreign networks."""

from __future__ import annotations

import numpy as np

from ...processes.wire import Arrays, Header, WireError
from ..types import Features, Matches


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
