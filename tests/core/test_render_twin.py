"""The fast rasteriser against its slow twin."""

from __future__ import annotations

import numpy as np

from core.camera import Intrinsics, Pose
from core.render import Renderer, RenderSettings, render_reference
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


def test_random_scene_matches_twin() -> None:
    k = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
    pose = Pose(t=np.array([0.1, -0.2, 0.3]))
    for coefficients in (1, 4, 9, 16):
        scene = random_scene(400, seed=coefficients, sh_coefficients=coefficients)
        fast, slow = Renderer(scene, RenderSettings(threads=1)).render(k, pose), render_reference(scene, k, pose)
        np.testing.assert_allclose(fast.color, slow.color, atol=1e-4)
        np.testing.assert_allclose(fast.alpha, slow.alpha, atol=1e-4)
        np.testing.assert_allclose(fast.depth[slow.alpha > 0.1], slow.depth[slow.alpha > 0.1], rtol=1e-3)
