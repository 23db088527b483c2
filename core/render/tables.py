"""What the renderer computes once per scene: origin-centred means, scaled axes, log opacities, SH by coefficient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..splats.scene import GaussianScene
from . import constants as c

Float32Array = NDArray[np.float32]

CHUNK = 1 << 15  # most Gaussians per work item: a dozen float32 columns of it stay in the cache

CUT_MARGIN = 2e-3  # so that rounding in the ellipse's edge never loses a pixel whose alpha reaches 1/255


@dataclass(frozen=True)
class SceneTables:
    """N Gaussians of opacity >= 1/255, in file order, one row per quantity.

    origin (3,) float64: added to `means` (3, N) float32 gives world coordinates. axes (9, N): row 3 i + j is world axis i of
    scaled Gaussian axis j. log_opacity (N,). cut (N,): 2 ln(255 opacity), the squared Mahalanobis radius at which alpha is
    1/255. reach (N,): sqrt(cut) times the largest scale, scene units. sh (K, 3, N).
    """

    origin: NDArray[np.float64]
    means: Float32Array
    axes: Float32Array
    log_opacity: Float32Array
    cut: Float32Array
    reach: Float32Array
    sh: Float32Array

    def __len__(self) -> int:
        return int(self.means.shape[1])


def build_tables(scene: GaussianScene) -> SceneTables:
    """Per-scene tables; Gaussians too transparent to ever count are left out."""
    keep = np.flatnonzero(scene.opacities >= np.float32(c.ALPHA_MIN))
    n = len(keep)
    means = scene.means[keep]
    origin = np.median(means, axis=0).astype(np.float64) if n else np.zeros(3)
    tables = SceneTables(
        origin=origin,
        means=np.empty((3, n), np.float32),
        axes=np.empty((9, n), np.float32),
        log_opacity=np.log(scene.opacities[keep]),
        cut=2 * np.log(scene.opacities[keep] / np.float32(c.ALPHA_MIN)),
        reach=np.empty(n, np.float32),
        sh=np.empty((scene.sh.shape[1], 3, n), np.float32),
    )
    np.add(np.maximum(tables.cut, 0.0), np.float32(CUT_MARGIN), out=tables.cut)
    for a in range(0, n, CHUNK):
        part = slice(a, a + CHUNK)
        _fill(tables, scene, keep[part], part)
    return tables


def _fill(tables: SceneTables, scene: GaussianScene, index: NDArray[np.intp], part: slice) -> None:
    tables.means[:, part] = (scene.means[index] - tables.origin).T
    scales = scene.scales[index]
    tables.reach[part] = np.sqrt(tables.cut[part]) * scales.max(axis=1, initial=0.0)
    tables.axes[:, part] = (_rotations(scene.rotations[index]) * scales[:, None, :]).reshape(-1, 9).T
    tables.sh[:, :, part] = scene.sh[index].transpose(1, 2, 0)


def _rotations(quaternions: Float32Array) -> Float32Array:
    """Unit quaternions w x y z (n, 4) to matrices (n, 3, 3)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows, np.float32).transpose(2, 0, 1)
