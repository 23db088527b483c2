"""A straight picture that is wide enough to be bent into the photo, against OpenCV's lens model."""

import cv2
import numpy as np
import pytest

from core.geometry.camera import Intrinsics
from core.pictures.overscan import MOST, overscan_ratio, overscanned
from core.pictures.stmap import distort_map

pytestmark = pytest.mark.unit

BARREL = Intrinsics(320, 240, 252.5, 251.75, 162.0, 118.25, (-0.11, 0.045, 0.0008, -0.0006, 0.0))
LENSES = [BARREL, Intrinsics(200, 300, 180.0, 185.0, 120.0, 140.0, (-0.1, 0.03, 0.0, 0.002, -0.005))]


def straight_pixels(lens, at):
    """Where pixels (N, 2) of the photo, by the engine's count, lie in the undistorted picture, by OpenCV."""
    K = lens.matrix
    return cv2.undistortPoints(np.asarray(at, np.float64)[:, None], K, np.array(lens.dist), None, K).reshape(-1, 2)


@pytest.mark.parametrize("lens", LENSES)
def test_every_pixel_of_the_photo_is_in_the_straight_picture(lens):
    ratio = overscan_ratio(lens)
    inside = distort_map(lens, overscanned(lens, ratio))
    assert inside.min() > 0
    assert inside.max() < 1
    x, y = np.linspace(0, lens.width, 201), np.linspace(0, lens.height, 201)
    edge = [np.stack(side, axis=1) for side in ((x, 0 * x), (x, 0 * x + lens.height), (0 * y, y), (0 * y + lens.width, y))]
    size = np.array([lens.width, lens.height])
    away = np.abs(straight_pixels(lens, np.concatenate(edge)) - size / 2) / (size / 2)
    assert away.max() <= ratio <= away.max() + 4 / size.min()  # no wider than it has to be


def test_the_map_looks_where_opencv_does():
    ratio = 1.25
    at = np.array([[0.5, 0.5], [160.5, 100.5], [319.5, 239.5]])
    want = (straight_pixels(BARREL, at) - (160, 120)) / ratio + (160, 120)
    got = distort_map(BARREL, overscanned(BARREL, ratio))
    for (x, y), (u, v) in zip(at, want, strict=True):
        s, t = got[int(y), int(x)]
        np.testing.assert_allclose((s * 320, (1 - t) * 240), (u, v), atol=1e-3)


def test_what_needs_no_more_gets_none():
    assert overscan_ratio(BARREL.pinhole()) == 1
    inwards = Intrinsics(320, 240, 250.0, 250.0, 160.0, 120.0, (0.1, 0.0, 0.0, 0.0, 0.0))
    assert overscan_ratio(inwards) == 1


def test_a_lens_without_end_is_held():
    assert overscan_ratio(Intrinsics(320, 240, 120.0, 120.0, 160.0, 120.0, (-0.3, 0.02, 0.0, 0.0, 0.0))) == MOST
