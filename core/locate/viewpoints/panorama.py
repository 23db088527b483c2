"""What a camera at a position would see all around, from a sample of the surface: cells of a cube map, filled or open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .surface import Surface

Float32Array = NDArray[np.float32]

SIDE = 12  # cells along each edge of a cube face
CELLS = 6 * SIDE * SIDE
CELL_SR = 4 * np.pi / CELLS
MAX_TAU = 3.0  # optical depth of one point at most; nearer ones would cover more than their cell
FILLED_TAU = 0.7
FACING_GAIN = 4.0  # how fast the plausibility falls as a point is seen from another side than it faces


@dataclass(frozen=True, eq=False)
class Panorama:
    """`cell` (N,) cube-map cell of each surface point; `seen` (N,) the light from it that arrives, 0..1; `weight` (N,) how
    plausible it is that the photographer stood here for it: `seen` times the match of its distance and side with the expected
    ones; `filled` (CELLS,) bool; `distance` (N,) scene units.
    """

    cell: NDArray[np.intp]
    seen: Float32Array
    weight: Float32Array
    filled: NDArray[np.bool_]
    distance: Float32Array

    @property
    def filled_share(self) -> float:
        return float(self.filled.mean())


def panorama_at(surface: Surface, position: Float32Array, expected: Float32Array, sigma: float) -> Panorama:
    """The panorama at `position` (3,). `expected` (N,): distance from which each point was photographed; `sigma`: deviation of
    its logarithm.
    """
    ray = surface.points - position.astype(np.float32)
    square = np.einsum("ij,ij->i", ray, ray) + np.float32(1e-12)
    cell = cube_cells(ray)
    tau = np.minimum(surface.area / (square * np.float32(CELL_SR)), np.float32(MAX_TAU))
    distance = np.sqrt(square)
    order = np.lexsort((distance, cell))
    sorted_cell = cell[order]
    total = np.cumsum(tau[order], dtype=np.float64)
    before = total - tau[order]
    first = np.flatnonzero(np.r_[True, sorted_cell[1:] != sorted_cell[:-1]])
    start = np.repeat(before[first], np.diff(np.r_[first, len(order)]))
    seen = np.empty(len(order), np.float32)
    seen[order] = np.exp(start - before)
    log_weight = np.log(distance / expected) ** 2 * np.float32(-0.5 / sigma**2)
    log_weight += facing_log(surface.facing, ray, distance)
    weight = seen * np.exp(log_weight)
    filled = np.bincount(cell, tau, minlength=CELLS) > FILLED_TAU
    return Panorama(cell, seen, weight, filled, distance)


def facing_log(facing: Float32Array, ray: Float32Array, distance: Float32Array) -> Float32Array:
    """Logarithm (N,) of how plausible it is to see points that face `facing` (N, 3) along `ray` (N, 3): 0 straight from there,
    down to twice minus FACING_GAIN from behind, less where the facing is unsure (short).
    """
    cosine = -np.einsum("ij,ij->i", facing, ray) / distance
    length = np.sqrt(np.einsum("ij,ij->i", facing, facing))
    return np.asarray(np.float32(FACING_GAIN) * (cosine - length))


def cube_cells(rays: Float32Array) -> NDArray[np.intp]:
    """The cube-map cell (N,) that each direction (N, 3) falls into."""
    axis = np.abs(rays).argmax(axis=1)
    rows = np.arange(len(rays))
    main = rays[rows, axis]
    size = np.maximum(np.abs(main), np.float32(1e-20))
    u = rays[rows, (axis + 1) % 3] / size
    v = rays[rows, (axis + 2) % 3] / size
    face = 2 * axis + (main < 0)
    i, j = (np.clip(((w + 1) * (SIDE / 2)).astype(np.intp), 0, SIDE - 1) for w in (u, v))
    return np.asarray((face * SIDE + i) * SIDE + j, np.intp)


def cell_directions() -> Float32Array:
    """Unit vectors (CELLS, 3) through the cells' middles, in the order of `cube_cells`."""
    face, i, j = np.unravel_index(np.arange(CELLS), (6, SIDE, SIDE))
    out = np.empty((CELLS, 3), np.float32)
    rows, axis = np.arange(CELLS), face // 2
    out[rows, axis] = np.where(face % 2, -1.0, 1.0)
    out[rows, (axis + 1) % 3] = (i + 0.5) * (2 / SIDE) - 1
    out[rows, (axis + 2) % 3] = (j + 0.5) * (2 / SIDE) - 1
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def view_directions() -> Float32Array:
    """42 unit vectors spread evenly (42, 3): the corners of an icosahedron and the middles of its edges."""
    g = (1 + 5**0.5) / 2
    corners = np.array([p for a in (-1, 1) for b in (-g, g) for p in ((0, a, b), (a, b, 0), (b, 0, a))], np.float64)
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    gram = corners @ corners.T
    a, b = np.nonzero(np.triu((gram > 0.4) & (gram < 0.9)))
    middles = corners[a] + corners[b]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    return np.concatenate([corners, middles]).astype(np.float32)
