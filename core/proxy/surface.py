"""The surface in a sparse grid as triangles: surface nets.

Gibson, "Constrained Elastic Surface Nets", 1998, without the relaxation: each cell that the surface passes through has one
vertex, at the mean of where the surface crosses the cell's edges, and each edge that it crosses joins the four cells around it.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from .blocks import CORNERS, SIDE, Blocks, IntArray
from .space import Float32Array

# A surface changes by 1 / BAND from voxel to voxel. Where one view alone sees a near surface beside a far one, voxels behind
# the near one lie beside voxels in the open, and the surface would go on behind its edge for as long as the band is: a rim as
# wide as this lets it be makes the edge as sharp as the voxels are, and the rest is no surface that anybody has seen.
STEP = 1.4


def surface_nets(blocks: Blocks) -> tuple[Float32Array, IntArray]:
    """Vertices (V, 3), in voxels, and triangles (F, 3), which face outwards: towards the cameras."""
    values = _padded(blocks)
    total = np.zeros((*blocks.distance.shape, 3), np.float32)
    count = np.zeros(blocks.distance.shape, np.float32)
    crossings = []
    for axis in range(3):
        there, cross = _crossings(values, axis)
        crossings.append(cross)
        for one, other in product((0, 1), (0, 1)):
            _add(total, count, there, axis, (one, other))
    block, *cell = np.nonzero(count)
    number = np.full(blocks.distance.shape, -1, np.int64)
    number[block, cell[0], cell[1], cell[2]] = np.arange(len(block))
    inside = total[block, cell[0], cell[1], cell[2]] / count[block, cell[0], cell[1], cell[2]][:, None]
    vertices = blocks.corners[block] + np.stack(cell, axis=1) + inside
    numbers = _padded_back(blocks, number)
    quads = np.concatenate([_quads(numbers, crossings[axis], axis) for axis in range(3)])
    return vertices.astype(np.float32), _split(vertices, quads[(quads >= 0).all(axis=1)])


def _padded(blocks: Blocks) -> Float32Array:
    """Distances with those of the next voxel on each axis, (B, SIDE + 1, SIDE + 1, SIDE + 1)."""
    out = np.full((len(blocks.keys), *[SIDE + 1] * 3), np.nan, np.float32)
    for offset in CORNERS:
        other = blocks.at(offset)
        own = tuple(slice(SIDE, None) if o else slice(0, SIDE) for o in offset)
        there = tuple(slice(0, 1) if o else slice(0, SIDE) for o in offset)
        have = np.flatnonzero(other >= 0)
        out[have, *own] = blocks.distance[other[have]][:, *there]
    return out


def _padded_back(blocks: Blocks, number: IntArray) -> IntArray:
    """Numbers with those of the cell before on each axis."""
    out = np.full((len(blocks.keys), *[SIDE + 1] * 3), -1, np.int64)
    for offset in CORNERS:
        other = blocks.at(-offset)
        own = tuple(slice(0, 1) if o else slice(1, None) for o in offset)
        there = tuple(slice(SIDE - 1, None) if o else slice(0, SIDE) for o in offset)
        have = np.flatnonzero(other >= 0)
        out[have, *own] = number[other[have]][:, *there]
    return out


def _crossings(values: Float32Array, axis: int) -> tuple[Float32Array, NDArray[np.int8]]:
    """Of each edge along `axis`: where it is crossed, 0..1, NaN where not; and the sign, 1 where it leads inwards, 0: none."""
    lead = [slice(None)] * 4
    lead[axis + 1] = slice(0, SIDE)
    a = values[tuple(lead)]
    lead[axis + 1] = slice(1, None)
    b = values[tuple(lead)]
    with np.errstate(invalid="ignore", divide="ignore"):
        crossed = ((a < 0) != (b < 0)) & (np.abs(a - b) < STEP)
        there = np.where(crossed, a / (a - b), np.nan).astype(np.float32)
    return there, np.where(crossed, np.where(b < 0, 1, -1), 0).astype(np.int8)


def _add(total: Float32Array, count: Float32Array, there: Float32Array, axis: int, corner: tuple[int, int]) -> None:
    """Adds the crossings of the edges at one corner, of the four around a cell, to their cells."""
    others = [k for k in range(3) if k != axis]
    part: list[slice] = [slice(None)] * 4
    for k, side in zip(others, corner, strict=True):
        part[k + 1] = slice(side, side + SIDE)
    found = there[tuple(part)]
    have = np.isfinite(found)
    count += have
    total[..., axis] += np.where(have, found, 0)
    for k, side in zip(others, corner, strict=True):
        if side:
            total[..., k] += have


def _quads(numbers: IntArray, cross: NDArray[np.int8], axis: int) -> IntArray:
    """The four cells around each crossed edge of the blocks' own (N, 4), in the order that faces outwards."""
    u, v = ((axis + 1) % 3, (axis + 2) % 3)
    block, *start = np.nonzero(cross[:, :SIDE, :SIDE, :SIDE])
    sign = cross[block, start[0], start[1], start[2]]
    corners = []
    for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
        at = [start[0] + 1, start[1] + 1, start[2] + 1]
        at[u], at[v] = at[u] - du, at[v] - dv
        corners.append(numbers[block, at[0], at[1], at[2]])
    quads = np.stack(corners, axis=1)
    return np.where((sign > 0)[:, None], quads[:, ::-1], quads)


def _split(vertices: NDArray[np.floating], quads: IntArray) -> IntArray:
    """Each quad as two triangles, along its shorter diagonal."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    first = ((a - c) ** 2).sum(axis=1) <= ((b - d) ** 2).sum(axis=1)
    turned = np.where(first[:, None], quads, np.roll(quads, -1, axis=1))
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
