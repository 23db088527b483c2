"""The fast rasteriser against its slow twin: ordinary scenes and every awkward one. A warning is a failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from render_scenes import assert_same_view, cloud, make_scene

from core.errors import Cancelled
from core.geometry.camera import Intrinsics, Pose
from core.render import Renderer, RenderSettings, render_reference
from core.splats.scene import GaussianScene

pytestmark = pytest.mark.filterwarnings("error")

CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)  # sides no multiple of a tile, principal point off the centre
MEANS, SCALES = cloud()


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_random_scene_matches_twin(coefficients: int) -> None:
    means, scales = cloud(400, seed=coefficients)
    scene, pose = make_scene(means, scales, coefficients=coefficients), Pose(t=np.array([0.1, -0.2, 0.3]))
    assert_same_view(Renderer(scene).render(CAMERA, pose), render_reference(scene, CAMERA, pose))


@pytest.mark.parametrize("size", [0.02, 0.3, 3.0])
def test_an_antialiased_scan_matches_twin(size: float) -> None:
    """Its small splats give less light than others' do, the same as large ones of which a pixel sees a part."""
    scene = replace(make_scene(MEANS, SCALES * size), antialiased=True)
    fast, slow = Renderer(scene).render(CAMERA, Pose()), render_reference(scene, CAMERA, Pose())
    assert_same_view(fast, slow)
    plain = Renderer(replace(scene, antialiased=False)).render(CAMERA, Pose())
    assert plain.alpha.sum() > (1.3 if size < 0.1 else 1.0) * fast.alpha.sum()


def test_a_small_antialiased_splat_gives_the_light_that_it_has() -> None:
    """Over all pixels, the alpha of a Gaussian of opacity o and variances a, b (pixels^2) sums to 2 pi o sqrt(a b)."""
    k = Intrinsics(41, 41, 40.0, 40.0, 20.5, 20.5)
    scene = make_scene([0.0, 0.0, 4.0], 0.05, opacity=0.9)
    light = [Renderer(replace(scene, antialiased=is_so)).render(k, Pose()).alpha.sum() for is_so in (True, False)]
    assert light[0] == pytest.approx(2 * np.pi * 0.9 * 0.5**2, rel=0.03)
    assert light[1] == pytest.approx(2 * np.pi * 0.9 * (0.5**2 + 0.3), rel=0.03)


def deep() -> GaussianScene:
    rng = np.random.default_rng(3)
    depth = 10 ** rng.uniform(-0.5, 5.5, (200, 1))
    return make_scene(np.hstack([rng.normal(size=(200, 2)) * 0.4, np.ones((200, 1))]) * depth, depth * SCALES * 0.3)


SCENES: dict[str, Callable[[], tuple[GaussianScene, Intrinsics, Pose]]] = {
    "camera inside": lambda: (make_scene(np.subtract(MEANS, (0, 0, 4)), SCALES), CAMERA, Pose()),
    "flat Gaussians, and points": lambda: (
        make_scene(MEANS, SCALES * np.array([1.0, 0.0, 1.0]) * (MEANS[:, :1] > 0)),
        CAMERA,
        Pose(),
    ),
    "opaque and invisible": lambda: (
        replace(make_scene(MEANS, SCALES), opacities=(MEANS[:, 0] > 0).astype(np.float32)),
        CAMERA,
        Pose(),
    ),
    "camera on a Gaussian": lambda: (make_scene(np.vstack([MEANS, np.zeros(3)]), 0.3), CAMERA, Pose()),
    "tiny focal length": lambda: (make_scene(MEANS, SCALES), replace(CAMERA, fx=0.5, fy=0.5), Pose()),
    "huge focal length": lambda: (
        make_scene(MEANS * (1e-3, 1e-3, 1), SCALES * 2e-3),
        replace(CAMERA, fx=2e5, fy=2e5),
        Pose(),
    ),
    "each covers the image": lambda: (make_scene(MEANS, 50.0, opacity=0.1), CAMERA, Pose()),
    "larger than the world": lambda: (make_scene(MEANS, 1e15, opacity=0.1), CAMERA, Pose()),
    "opaque": lambda: (make_scene(MEANS, SCALES * 4, opacity=1.0), CAMERA, Pose()),
    "just one": lambda: (make_scene([[0, 0, 3]], [[0.3, 0.1, 0.2]], opacity=0.9), CAMERA, Pose()),
    "one pixel": lambda: (make_scene(MEANS, SCALES), Intrinsics(1, 1, 5.0, 5.0, 0.5, 0.5), Pose()),
    "needles": lambda: (make_scene(MEANS, (20.0, 1e-4, 1e-4)), CAMERA, Pose()),
    "discs": lambda: (make_scene(MEANS, (1.0, 1.0, 1e-6)), CAMERA, Pose()),
    "points": lambda: (make_scene(MEANS, 0.0), CAMERA, Pose()),
    "depths over six orders of magnitude": lambda: (deep(), CAMERA, Pose()),
    "centres far outside the image": lambda: (make_scene(np.add(MEANS, (500, 0, 0)), 200.0), CAMERA, Pose()),
    "far from the origin": lambda: (
        make_scene(np.add(MEANS, (4e5, 5e6, 0)), SCALES),
        CAMERA,
        Pose(t=-np.array([4e5, 5e6, 0.0])),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_awkward_scene_matches_twin(name: str) -> None:
    scene, intrinsics, pose = SCENES[name]()
    slow = render_reference(scene, intrinsics, pose)
    assert slow.alpha.max() > 0.05, "the case shows nothing, hence would prove nothing"
    assert_same_view(Renderer(scene).render(intrinsics, pose), slow)


@pytest.mark.parametrize(
    ("scene", "pose"),
    [
        (make_scene(MEANS, SCALES), Pose(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))),
        (make_scene(MEANS, SCALES, opacity=0.001), Pose()),
        (make_scene(np.zeros((0, 3)), np.zeros((0, 3))), Pose()),
    ],
    ids=["camera looks away", "all transparent", "no Gaussians"],
)
def test_nothing_visible_is_black(scene: GaussianScene, pose: Pose) -> None:
    view = Renderer(scene).render(CAMERA, pose)
    assert all(not a.any() for a in (view.color, view.depth, view.alpha, view.depth_variance))
    assert view.color.shape == (CAMERA.height, CAMERA.width, 3)


def test_equal_depths_keep_file_order() -> None:
    scene = make_scene(np.tile([0.0, 0.0, 3.0], (40, 1)), 0.3, opacity=0.6)
    assert_same_view(Renderer(scene).render(CAMERA, Pose()), render_reference(scene, CAMERA, Pose()))


def test_threads_do_not_change_a_bit() -> None:
    means, scales = cloud(20_000, seed=5)
    scene, k = make_scene(means, scales * 0.2), Intrinsics(400, 300, 300.0, 300.0, 200.0, 150.0)
    one, two = (Renderer(scene, RenderSettings(threads=n)).render(k, Pose()) for n in (1, 2))
    for field in ("color", "depth", "alpha", "depth_variance"):
        assert np.array_equal(getattr(one, field), getattr(two, field))


def test_an_opencv_that_multiplies_out_of_order_draws_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels are chained by one multiplication whose source and result overlap; where that does not hold, one by one."""
    means, scales = cloud(5000, seed=5)
    scene, k = make_scene(means, scales * 0.3), Intrinsics(100, 80, 80.0, 80.0, 50.0, 40.0)
    want = Renderer(scene).render(k, Pose())

    def from_a_copy(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> np.ndarray:
        return np.multiply(a.copy(), b, out=out)

    monkeypatch.setattr(cv2, "multiply", from_a_copy)
    got = Renderer(scene).render(k, Pose())
    assert want.alpha.max() > 0.99
    assert np.array_equal(got.color, want.color)
    assert np.array_equal(got.depth, want.depth)


@pytest.mark.parametrize("opacity", [0.02, 0.3, 1.0])
def test_a_tile_with_thousands_of_gaussians_matches_twin(opacity: float) -> None:
    """Lists of many rounds: of pixels that stay clear, that end half-way down, and that end at once."""
    rng = np.random.default_rng(7)
    means = np.hstack([rng.normal(size=(3000, 2)) * 0.05, rng.uniform(2, 5, (3000, 1))])
    scene, camera = make_scene(means, 0.05, opacity=opacity), Intrinsics(24, 20, 60.0, 60.0, 12.0, 10.0)
    slow = render_reference(scene, camera, Pose())
    assert slow.alpha.max() > 0.99
    assert_same_view(Renderer(scene).render(camera, Pose()), slow)


def test_near_plane_is_a_setting() -> None:
    scene = make_scene([[0, 0, 0.1]], 0.01, opacity=0.9)
    assert not Renderer(scene).render(CAMERA, Pose()).alpha.any()
    settings = RenderSettings(near=0.05)
    view = Renderer(scene, settings).render(CAMERA, Pose())
    assert_same_view(view, render_reference(scene, CAMERA, Pose(), settings))
    assert view.alpha.max() > 0.5


@pytest.mark.parametrize("threads", [1, 2])
def test_cancel_stops_the_render(threads: int) -> None:
    polls: list[None] = []

    def stop_at_third() -> bool:
        polls.append(None)
        return len(polls) >= 3

    renderer = Renderer(make_scene(MEANS, SCALES), RenderSettings(threads=threads))
    with pytest.raises(Cancelled):
        renderer.render(CAMERA, Pose(), stop_at_third)
    assert renderer.render(CAMERA, Pose()).alpha.any()


def test_large_image_is_drawn_in_bands() -> None:
    k = Intrinsics(8000, 6000, 7000.0, 7000.0, 4000.0, 3000.0)
    scene = make_scene([[0, 0, 3], [0.5, -0.3, 4]], [[0.5, 0.2, 0.3], [0.05, 0.01, 0.1]], opacity=0.9)
    view = Renderer(scene).render(k, Pose())
    small = k.resized(80, 60)
    corner = Intrinsics(40, 30, k.fx, k.fy, k.cx - 5100, k.cy - 2400)  # a window of the large image around the second Gaussian
    window = view.color[2400:2430, 5100:5140]
    np.testing.assert_allclose(window, render_reference(scene, corner, Pose()).color, atol=2e-3)
    assert window.max() > 0.05
    coarse = view.alpha.reshape(60, 100, 80, 100).mean(axis=(1, 3))
    assert abs(coarse.mean() - render_reference(scene, small, Pose()).alpha.mean()) < 2e-3
