"""Splats as the viewport's shader wants them, and their order for a view. Numpy alone: fit for worker threads.

The Gaussians stand in the tables in a random order that never changes, so that the first M of them are a fair sample of the
whole: that is what is drawn of a large scan while the view moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.render.project import ascending_order
from ...core.render.view import INRIA_NEAR, NEAR_RATIO
from ...core.splats.activate import SH_C0

TABLE_WIDTH = 4096  # In texels; with a height of 16384 a table holds 67 million Gaussians.
CHUNK = 1 << 17
SEED = 0
LARGEST_BOOST = 2.0
SAMPLE = 20_000  # How many points the near plane is estimated from.


@dataclass(frozen=True)
class SplatTables:
    """`count` Gaussians in shuffled order: means (N, 3), and three float32 tables (H, TABLE_WIDTH, 4), zero beyond them.

    place: x y z, opacity. shape: covariance xx xy xz yy. color: covariance yz zz, colour as 65536 r + 256 g + b, nothing.
    near: distance, in the object's units, within which a Gaussian is not drawn, as in the engine's renderer.
    """

    count: int
    means: np.ndarray
    place: np.ndarray
    shape: np.ndarray
    color: np.ndarray
    near: float


def build_tables(means: np.ndarray, scales: np.ndarray, rotations: np.ndarray, base: np.ndarray, limit: int) -> SplatTables:
    """Tables of at most `limit` Gaussians, chosen at random; `base` (N, 4) holds f_dc and opacity.

    Gaussians with values that are not finite are drawn nowhere.
    """
    chosen = np.random.default_rng(SEED).permutation(len(means))[:limit].astype(np.int32)
    count = len(chosen)
    place, shape, color = (np.zeros((-(-max(count, 1) // TABLE_WIDTH) * TABLE_WIDTH, 4), np.float32) for _ in range(3))
    for start in range(0, count, CHUNK):
        part = chosen[start : start + CHUNK]
        rows = slice(start, start + len(part))
        place[rows, :3] = means[part]
        place[rows, 3] = np.clip(base[part, 3], 0, 1)
        cov = _covariances(scales[part], rotations[part])
        shape[rows] = cov[:4].T
        color[rows, :2] = cov[4:].T
        color[rows, 2] = _packed_colours(base[part, :3])
        bad = ~np.isfinite(np.concatenate([place[rows], shape[rows], color[rows]], axis=1)).all(axis=1)
        for table in (place, shape, color):
            table[rows][bad] = 0.0
    shuffled = np.ascontiguousarray(place[:count, :3])
    places, shapes, colors = (table.reshape(-1, TABLE_WIDTH, 4) for table in (place, shape, color))
    return SplatTables(count, shuffled, places, shapes, colors, near_distance(shuffled))


def _covariances(scales: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """xx xy xz yy yz zz (6, n) from standard deviations and quaternions w x y z of any length."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        w, x, y, z = (rotations / np.linalg.norm(rotations, axis=1, keepdims=True)).T
        axes = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        rows = [np.stack(row) * scales.T for row in axes]
        return np.stack([(rows[i] * rows[j]).sum(axis=0) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))])


def _packed_colours(dc: np.ndarray) -> np.ndarray:
    """Colours of SH degree 0 in 3 x 8 bits, as one float32, which holds 24 bits exactly."""
    with np.errstate(invalid="ignore"):
        levels = np.floor(np.clip(0.5 + SH_C0 * dc, 0, 1) * 255 + 0.5)
    return levels @ np.array([65536.0, 256.0, 1.0], np.float32)


def near_distance(means: np.ndarray) -> float:
    """The near distance as RenderSettings.for_scene computes it, from a sample: the first means, whose order is random."""
    some = means[:SAMPLE]
    if not len(some):
        return INRIA_NEAR
    radius = np.linalg.norm(some - np.median(some, axis=0), axis=1)
    return min(INRIA_NEAR, NEAR_RATIO * float(np.median(radius))) or INRIA_NEAR


def back_to_front(means: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Indices of `means` (n, 3) from the farthest to the nearest, as float32, when the view looks along -`direction`."""
    height = means @ direction.astype(np.float32)
    height -= height.min()
    # The nearest have the largest value along `direction` and are drawn last.
    return ascending_order(height).astype(np.float32)


def order_table(order: np.ndarray) -> np.ndarray:
    """The order as a table (H, TABLE_WIDTH) for the shader."""
    table = np.zeros(-(-max(len(order), 1) // TABLE_WIDTH) * TABLE_WIDTH, np.float32)
    table[: len(order)] = order
    return table.reshape(-1, TABLE_WIDTH)


def boost_for(drawn: int, total: int) -> float:
    """How much larger each Gaussian is drawn when only `drawn` of `total` are, so that surfaces stay closed."""
    return float(min(LARGEST_BOOST, (total / max(drawn, 1)) ** 0.5))
