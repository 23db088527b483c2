"""A scan of many small Gaussians that looks like the one that it was split from."""

import numpy as np
import pytest

from core.render import Renderer, RenderSettings
from core.synthetic import make_scene, sample_cameras
from core.synthetic.split import split_scene


@pytest.fixture(scope="module")
def room():
    return make_scene(gaussians=8000)


@pytest.mark.parametrize("parts", [(4, 1), (8, 4)])
def test_a_split_scan_looks_as_before(room, parts):
    camera = sample_cameras()[0]
    k = camera.intrinsics.pinhole().with_long_side(200)
    plain = Renderer(room, RenderSettings(threads=1)).render(k, camera.pose)
    pixel = float(np.median(plain.depth[plain.alpha > 0.9])) / k.focal
    split = split_scene(room, parts, pixel)
    assert len(split) == parts[0] * parts[1] * len(room)
    drawn = Renderer(split, RenderSettings(threads=1)).render(k, camera.pose)
    error = 255 * np.abs(drawn.color - plain.color).max(axis=2)
    middle, most = (float(value) for value in np.quantile(error, (0.5, 0.99)))
    assert middle < 8, "of 255"
    assert most < 70, "of 255"
    assert float(np.abs(drawn.alpha - plain.alpha).mean()) < 0.02
    assert float(np.median(np.abs(drawn.depth / plain.depth - 1))) < 0.01


def test_parts_are_smaller_and_lie_around_their_one(room):
    split = split_scene(room, (8, 4), 0.0)
    means = split.means.reshape(len(room), 32, 3)
    np.testing.assert_allclose(means.mean(axis=1), room.means, atol=1e-4)
    assert (split.scales.max(axis=1) <= 0.8 * np.repeat(room.scales.max(axis=1), 32)).all()
    reach = np.linalg.norm(means - room.means[:, None], axis=2).max(axis=1)
    assert (reach < 3.2 * room.scales.max(axis=1)).all()
