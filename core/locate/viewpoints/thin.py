"""The scan as the map's small views need it: surfaces without haze, no more Gaussians than pixels can show, one colour each."""

from __future__ import annotations

import numpy as np

from ...geometry.camera import Intrinsics
from ...splats.scene import GaussianScene

# Fainter Gaussians are left out: they cost as much as others, and a pixel that shows several of them has no one depth.
HAZE = 0.1
FINEST_PX = 0.5  # width of the Gaussians, in a view's pixels, that a view resolves


def thinned(scene: GaussianScene, share: float, seed: int) -> GaussianScene:
    """The scene without haze and without the colours of directions. `share`: of the others, so many, drawn at random, stay,
    each wider by so much that together they cover as much as all did.
    """
    keep = np.flatnonzero(scene.opacities >= HAZE)
    if len(keep) == 0:
        keep = np.arange(len(scene))
    scales = 1.0
    if share < 1:
        rng = np.random.default_rng(seed)
        keep = np.sort(rng.choice(keep, round(share * len(keep)), replace=False))
        scales = share**-0.5
    return GaussianScene(
        scene.means[keep],
        scene.scales[keep] * np.float32(scales),
        scene.rotations[keep],
        scene.opacities[keep],
        np.ascontiguousarray(scene.sh[keep, :1]),
    )


def share_for(camera: Intrinsics, ratio: float) -> float:
    """The share of the Gaussians that `camera` can show, where surfaces lie `ratio` times their Gaussians' width away."""
    width_px = camera.focal / ratio
    return min(1.0, (width_px / FINEST_PX) ** 2)
