"""The mesh of a single view: every pixel that has a depth is two triangles, cut where the depth jumps.

What one camera alone sees needs no fusing, and voxels are not as fine across its picture as its pixels are: CG is cut off at
the outlines of things, which lie between the pixels that show them and those that show what is behind.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray
from .pieces import IntArray, compacted, open_edges, without_floaters
from .views import DepthView, bent

BoolArray = NDArray[np.bool_]

# Of the depth: neighbours that are farther apart than JUMP belong to two surfaces unless they lie along a plane, which no
# camera sees so aslant that they were STEEP apart.
JUMP, STEEP = 0.03, 0.08
ROUNDS = 2  # of smoothing along outlines, which are stairs of pixels at first
# The corners of a pixel, right and down of its upper left one.
CORNERS = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
TRIANGLES = ((0, 2, 1), (1, 2, 3))  # facing the camera


def view_surface(view: DepthView) -> tuple[FloatArray, IntArray]:
    """Vertices (V, 3) in the scan's coordinates, and triangles (F, 3) that face the camera, without floaters.

    Neighbouring pixels of one surface share the vertices at their corners; those of two surfaces have each their own.
    """
    known = view.depth > 0
    inverse = np.where(known, 1 / np.where(known, view.depth, 1), 0)
    across, down = (_joined(view, axis) for axis in (1, 0))
    number = _numbered(across, down)[known.ravel()]
    height, width = known.shape
    rows, columns = np.divmod(np.flatnonzero(known), width)
    vertices, number = np.unique(number, return_inverse=True)
    number = number.reshape(-1, 4)
    values = _at_corners(inverse, across, down)[known]
    mean = np.bincount(number.ravel(), values.ravel()) / np.bincount(number.ravel())
    places = np.empty((len(vertices), 2))
    places[number] = np.stack([columns, rows], axis=1)[:, None] + CORNERS
    faces = without_floaters(np.concatenate([number[:, corners] for corners in TRIANGLES]), len(vertices))
    rays = np.column_stack([view.camera.intrinsics.normalise(_smooth(places, faces)), np.ones(len(places))])
    points = view.camera.pose.inverse().transform(rays / mean[:, None])
    return compacted(points, faces)


def _joined(view: DepthView, axis: int) -> BoolArray:
    """Whether each pixel (H, W) and the next one along the axis show the same surface."""
    depth, bend = view.depth, bent(view.depth)
    after, bend_after = (np.roll(values, -1, axis) for values in (depth, bend))
    near, far = np.minimum(depth, after), np.maximum(depth, after)
    joined = (near > 0) & (far - near <= np.where(bend | bend_after, JUMP, STEEP) * near)
    np.moveaxis(joined, axis, 0)[-1] = False
    return np.asarray(joined)


def _numbered(across: BoolArray, down: BoolArray) -> IntArray:
    """One number for all corners of pixels that are one vertex (H * W, 4)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = np.arange(4 * across.size).reshape(*across.shape, 4)
    pairs = [(corners[:, :-1][across[:, :-1]], corners[:, 1:][across[:, :-1]], ((1, 0), (3, 2)))]
    pairs += [(corners[:-1][down[:-1]], corners[1:][down[:-1]], ((2, 0), (3, 1)))]
    starts = np.concatenate([one[:, a] for one, _, both in pairs for a, _ in both])
    ends = np.concatenate([other[:, b] for _, other, both in pairs for _, b in both])
    links = coo_array((np.ones(len(starts), bool), (starts, ends)), shape=(corners.size, corners.size))
    return np.asarray(connected_components(links, directed=False)[1]).reshape(-1, 4)


def _at_corners(inverse: FloatArray, across: BoolArray, down: BoolArray) -> FloatArray:
    """The inverse depth of each pixel's surface at the pixel's corners (H, W, 4): it is linear along a plane."""
    slopes = [_slope(inverse, joined, axis) for joined, axis in ((across, 1), (down, 0))]
    change = sum(slope[..., None] * (CORNERS[:, k] - 0.5) for k, slope in enumerate(slopes))
    return np.asarray(np.maximum(inverse[..., None] + change, 0.5 * inverse[..., None]))


def _slope(values: FloatArray, joined: BoolArray, axis: int) -> FloatArray:
    """The mean difference of each value (H, W) to the neighbours along the axis that it is joined with."""
    ahead = np.where(joined, np.roll(values, -1, axis) - values, 0)
    count = joined.astype(int) + np.roll(joined, 1, axis)
    return np.asarray((ahead + np.roll(ahead, 1, axis)) / np.maximum(count, 1))


def _smooth(places: FloatArray, faces: IntArray) -> FloatArray:
    """Pixels of vertices (V, 2), those on an outline between its neighbours there."""
    ends = open_edges(faces)
    start, end = np.concatenate([ends, ends[:, ::-1]]).T
    count = np.bincount(start, minlength=len(places))
    moves = count == 2
    for _ in range(ROUNDS):
        middle = np.stack([np.bincount(start, places[end, k], len(places)) for k in (0, 1)], axis=1) / 2
        places = np.where(moves[:, None], (places + middle) / 2, places)
    return places
