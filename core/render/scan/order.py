"""The order of Gaussians in space, so that what lies together in the world lies together in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
IndexArray = NDArray[np.intp]

# Of the cell's number along each axis; three such numbers make a code.
AXIS_BITS = 10
# Of all Gaussians, those that extend farthest.
WIDE_SHARE = 0.05


def spatial_order(places: Float32Array, reach: Float32Array) -> IndexArray:
    """The order (n,) in which Gaussians at the places (n, 3), relative to the middle of a scan, follow a Z curve (Morton,
    1966); stable. reach (n,): how far each extends. The widest follow a curve of their own, after all others, because one of
    them would make the whole block that it lies in reach far.

    The curve's cells grow with the distance from the middle: a scan is dense there, and far points are few.
    """
    size = np.abs(places)
    distance = max(float(np.median(size)), 1e-6 * float(size.max()), 1e-30) if len(places) else 1.0
    code = np.zeros(len(places), np.uint32)
    for axis in range(3):
        along = np.arcsinh(places[:, axis] / np.float32(distance))
        low, high = (float(along.min()), float(along.max())) if len(along) else (0.0, 0.0)
        cell = ((along - np.float32(low)) * np.float32(((1 << AXIS_BITS) - 1) / max(high - low, 1e-9))).astype(np.uint32)
        code |= _spread(cell) << np.uint32(axis)
    if len(places):
        code |= (reach > np.quantile(reach, 1 - WIDE_SHARE)).astype(np.uint32) << np.uint32(3 * AXIS_BITS)
    return stable_order(code)


def _spread(cell: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The bits of numbers of AXIS_BITS bits, two places apart."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cell = (cell | cell << np.uint32(shift)) & np.uint32(mask)
    return cell


def stable_order(keys: NDArray[np.uint32]) -> IndexArray:
    """Stable ascending order of keys (n,): radix-sorted in two halves, because numpy does that for 16 bits alone."""
    first = np.argsort(keys.astype(np.uint16), kind="stable")
    high = (keys >> np.uint32(16)).astype(np.uint16).take(first)
    return first.take(np.argsort(high, kind="stable"))
