"""Painted surfaces as a scan has them: Gaussians of SH degree 1 with a little gloss."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.camera import FloatArray
from ..splats.scene import GaussianScene
from .surfaces import SH_C0, Surfels
from .textures import Rng

OPACITY = 0.99
GLOSS = 0.05  # size of the first-degree SH coefficients: what changes with the direction it is seen from


def joined(parts: Sequence[Surfels]) -> Surfels:
    """All parts as one, in their order."""
    return Surfels(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("centres", "axes", "scales", "colors")))


def painted_scene(rng: Rng, made: Surfels, shade: FloatArray) -> GaussianScene:
    """The scan of the surfels. The third axis is the side that is seen; `shade` (N,): brightness factor."""
    from scipy.spatial.transform import Rotation  # here, because every process imports this module and few paint

    colors = np.clip(made.colors * shade[:, None], 0.01, 0.99)
    n = len(colors)
    sh = np.zeros((n, 4, 3), np.float32)
    sh[:, 0] = (colors - 0.5) / SH_C0
    sh[:, 1:] = GLOSS * _sheen(made.axes) * colors[:, None, :] + 0.01 * rng.normal(size=(n, 3, 3))
    return GaussianScene(
        means=made.centres.astype(np.float32),
        scales=made.scales.astype(np.float32),
        rotations=np.ascontiguousarray(Rotation.from_matrix(made.axes).as_quat()[:, [3, 0, 1, 2]], np.float32),
        opacities=np.full(n, OPACITY, np.float32),
        sh=sh,
        format="procedural",
    )


def _sheen(axes: FloatArray) -> FloatArray:
    """First-degree coefficients (N, 3, 1) that brighten a surface seen along its normal; SH order is -y, z, -x."""
    normal = axes[:, :, 2]
    return np.stack([normal[:, 1], -normal[:, 2], normal[:, 0]], axis=1)[:, :, None]
