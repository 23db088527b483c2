"""The sparse grid: blocks of SIDE^3 voxels where a surface may be, and signed distances fused in them.

Curless and Levoy, "A Volumetric Method for Building Complex Models from Range Images", 1996: the weighted mean of every view's
signed distance, cut off at a band's width. Behind a surface, beyond the band, a view says nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray
from ..geometry.conventions import to_opencv_pixels
from .space import Float32Array, GridSpace
from .views import JUMP, DepthView

SIDE = 4
BAND = 3.0  # voxels to either side of a surface
CHUNK = 8192  # blocks that are fused at once
BITS = 21  # of a coordinate of a block in its key
HALF = 1 << (BITS - 1)
NEAR = 1e-6
ROW = 1024
STEP_PX = 2  # every so many pixels are looked at for where a surface is; the band around it covers the others

IntArray = NDArray[np.int64]
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
VOXELS = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Blocks:
    """`keys` (B,) sorted, one per block; `distance` (B, SIDE, SIDE, SIDE), signed, in bands (1 = outside, at the band's end),
    NaN where no view says anything. `voxel`: a voxel's side in grid units.
    """

    keys: IntArray
    distance: Float32Array
    voxel: float

    @property
    def corners(self) -> IntArray:
        """The first voxel of each block (B, 3), counted in voxels."""
        return SIDE * coordinates(self.keys)

    def at(self, offset: Sequence[int]) -> IntArray:
        """For each block the index of the block that lies `offset` blocks from it; -1 where there is none."""
        wanted = keys_of(coordinates(self.keys) + np.asarray(offset))
        found = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
        return np.where(self.keys[found] == wanted, found, -1)


def keys_of(coordinates: IntArray) -> IntArray:
    """One number for each block at (N, 3)."""
    shifted = coordinates.astype(np.int64) + HALF
    return np.asarray((shifted[:, 0] << 2 * BITS) | (shifted[:, 1] << BITS) | shifted[:, 2])


def coordinates(keys: IntArray) -> IntArray:
    """Inverse of `keys_of`."""
    mask = (1 << BITS) - 1
    return np.stack([keys >> 2 * BITS, (keys >> BITS) & mask, keys & mask], axis=1) - HALF


def surface_cells(views: Iterable[DepthView], space: GridSpace, size: float) -> IntArray:
    """The keys of cells of `size` (grid units) in which some view sees a surface."""
    found = np.zeros(0, np.int64)
    for view in views:
        cells = np.floor(space.to_grid(view.points(STEP_PX) - space.centre) / size).astype(np.int64)
        found = np.union1d(found, np.unique(keys_of(cells)))
    return found


def allocated(cells: IntArray) -> IntArray:
    """The keys of blocks that hold all voxels within the band around surface voxels, which are given by their keys."""
    middle = coordinates(cells) + 0.5
    found = np.zeros(0, np.int64)
    for offset in product((-BAND, 0.0, BAND), repeat=3):
        found = np.union1d(found, keys_of(np.floor((middle + offset) / SIDE).astype(np.int64)))
    return found


def fused(keys: IntArray, views: Sequence[DepthView], space: GridSpace, voxel: float) -> Iterator[Float32Array]:
    """The distances of chunk after chunk of the blocks, (CHUNK, SIDE, SIDE, SIDE)."""
    for begin in range(0, len(keys), CHUNK):
        part = SIDE * coordinates(keys[begin : begin + CHUNK])[:, None] + VOXELS
        points = space.from_grid(part.reshape(-1, 3) * np.float32(voxel))
        band = BAND * voxel * space.scale(points)
        total, weights = np.zeros(len(points), np.float32), np.zeros(len(points), np.float32)
        for view in views:
            index, distance, weight = _seen(view, points, space, band)
            total[index] += weight * distance
            weights[index] += weight
        with np.errstate(invalid="ignore"):
            yield np.where(weights > 0, total / weights, np.nan).astype(np.float32).reshape(-1, SIDE, SIDE, SIDE)


def _seen(
    view: DepthView, points: Float32Array, space: GridSpace, band: Float32Array
) -> tuple[NDArray[np.intp], Float32Array, Float32Array]:
    """Of points relative to the grid's centre: the indices of those that the view says something of, and what."""
    pose = view.camera.pose.relative_to(space.centre)
    local = points @ pose.R.T.astype(np.float32) + pose.t.astype(np.float32)
    k = view.camera.intrinsics
    z = np.maximum(local[:, 2], np.float32(NEAR))
    x, y = local[:, 0] / z * np.float32(k.fx) + np.float32(k.cx), local[:, 1] / z * np.float32(k.fy) + np.float32(k.cy)
    index = np.flatnonzero((local[:, 2] > NEAR) & (x >= 0) & (y >= 0) & (x < k.width) & (y < k.height))
    pixels = np.stack([x[index], y[index]], axis=1).astype(np.float64)
    column, row = pixels.astype(np.intp).T
    depth = _depth_at(view.depth, pixels, np.asarray(view.depth[row, column]))
    distance = (depth - local[index, 2]) * view.slope[row, column] / band[index]
    weight = view.weight[row, column]
    kept = (distance > -1) & (weight > 0)
    return index[kept], np.minimum(distance[kept], 1).astype(np.float32), weight[kept]


def _depth_at(depth: Float32Array, pixels: FloatArray, nearest: Float32Array) -> Float32Array:
    """Depth at places between pixels (N, 2): bilinear within a surface, the pixel's own beside a jump."""
    count = len(pixels)
    if count == 0:
        return nearest
    places = np.zeros((-(-count // ROW), ROW, 2), np.float32)  # OpenCV takes no side of 32768 or more
    places.reshape(-1, 2)[:count] = to_opencv_pixels(pixels)
    found = cv2.remap(depth, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    smooth = found.ravel()[:count]
    return np.where(np.abs(smooth - nearest) < JUMP / 2 * nearest, smooth, nearest)
