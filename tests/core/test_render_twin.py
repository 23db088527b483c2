"""The fast rasteriser against its slow twin."""

from __future__ import annotations

import numpy as np
import pytest

from core.camera import Intrinsics, Pose
from core.render import RenderedView, Renderer, RenderSettings, render_reference
from core.splats.scene import GaussianScene


def random_scene(n: int, seed: int, sh_coefficients: int = 16) -> GaussianScene:
    """n Gaussians of mixed sizes and shapes in front of a camera at the origin."""
    rng = np.random.default_rng(seed)
    rotations = rng.normal(size=(n, 4))
    return GaussianScene(
        means=(rng.normal(size=(n, 3)) * (1.5, 1.0, 1.5) + (0, 0, 4)).astype(np.float32),
        scales=np.exp(rng.uniform(-5, -0.5, (n, 3))).astype(np.float32),
        rotations=(rotations / np.linalg.norm(rotations, axis=1, keepdims=True)).astype(np.float32),
        opacities=rng.uniform(0, 1, n).astype(np.float32),
        sh=(rng.normal(size=(n, sh_coefficients, 3)) * 0.4).astype(np.float32),
    )


def assert_same_view(fast: RenderedView, slow: RenderedView, odd_fraction: float = 2e-3) -> None:
    """Equal up to float32 rounding; at most `odd_fraction` of the pixels may show a decision at 1/255 or T = 1e-4 flipped."""
    for field in ("color", "depth", "alpha", "depth_variance"):
        assert np.isfinite(getattr(fast, field)).all()
    off = np.abs(fast.color - slow.color).max(axis=2) > 1e-4
    off |= np.abs(fast.alpha - slow.alpha) > 1e-4
    solid = slow.alpha > 0.1
    off |= solid & (np.abs(fast.depth - slow.depth) > 1e-3 * slow.depth)
    off |= solid & (np.abs(fast.depth_variance - slow.depth_variance) > 1e-3 * slow.depth_variance + 1e-5 * slow.depth**2)
    assert off.sum() <= max(1, odd_fraction * off.size)
    assert np.abs(fast.color - slow.color).max() < 0.02


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_random_scene_matches_twin(coefficients: int) -> None:
    k = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
    pose = Pose(t=np.array([0.1, -0.2, 0.3]))
    scene = random_scene(400, seed=coefficients, sh_coefficients=coefficients)
    assert_same_view(Renderer(scene, RenderSettings(threads=1)).render(k, pose), render_reference(scene, k, pose))
