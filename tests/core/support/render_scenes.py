"""Small scenes and the comparison that the rasteriser's tests share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from core.render import RenderedView
from core.splats.scene import GaussianScene


def make_scene(means: ArrayLike, scales: ArrayLike, opacity: float | None = None, coefficients: int = 4) -> GaussianScene:
    """Gaussians at `means` with random rotations and colours; random opacities unless one is given."""
    means = np.asarray(means, np.float32).reshape(-1, 3)
    n, rng = len(means), np.random.default_rng(7)
    rotations = rng.normal(size=(n, 4))
    opacities = rng.uniform(0, 1, n) if opacity is None else np.full(n, opacity)
    return GaussianScene(
        means=means,
        scales=np.ascontiguousarray(np.broadcast_to(np.asarray(scales, np.float32), (n, 3))),
        rotations=(rotations / np.linalg.norm(rotations, axis=1, keepdims=True)).astype(np.float32),
        opacities=opacities.astype(np.float32),
        sh=(rng.normal(size=(n, coefficients, 3)) * 0.4).astype(np.float32),
    )


def cloud(n: int = 200, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Means (n, 3) around (0, 0, 4) and mixed scales (n, 3)."""
    rng = np.random.default_rng(seed)
    return np.add(rng.normal(size=(n, 3)), (0, 0, 4)), np.exp(rng.uniform(-4, -0.5, (n, 3)))


def assert_same_view(fast: RenderedView, slow: RenderedView, odd_fraction: float = 2e-3) -> None:
    """Equal up to float32 rounding; at most `odd_fraction` of the pixels may show a decision at 1/255 or T = 1e-4 flipped."""
    for field in ("color", "depth", "alpha", "depth_variance"):
        assert np.isfinite(getattr(fast, field)).all()
        assert getattr(fast, field).dtype == np.float32
    off = np.abs(fast.color - slow.color).max(axis=2) > 1e-4
    off |= np.abs(fast.alpha - slow.alpha) > 1e-4
    solid = slow.alpha > 0.1
    off |= solid & (np.abs(fast.depth - slow.depth) > 1e-3 * slow.depth)
    off |= solid & (np.abs(fast.depth_variance - slow.depth_variance) > 1e-3 * slow.depth_variance + 1e-5 * slow.depth**2)
    assert off.sum() <= odd_fraction * off.size + 1
    assert np.abs(fast.color - slow.color).max() < 0.02
