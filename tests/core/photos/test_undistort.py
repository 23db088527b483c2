"""Undistorted photos: a point of the world must lie where the pinhole camera sees it."""

import numpy as np
import pytest

from core.geometry.camera import Intrinsics
from core.photos import undistort
from core.photos.photo import Photo

LENS = Intrinsics(320, 240, 250.0, 255.0, 165.0, 118.0, (-0.25, 0.08, 0.002, -0.001, 0.0))


def spots(at):
    """A dark photo with bright soft spots at the pixels given."""
    y, x = np.mgrid[:240, :320] + 0.5
    light = sum(np.exp(-((x - px) ** 2 + (y - py) ** 2) / 8) for px, py in at)
    return np.repeat((255 * np.clip(light, 0, 1))[..., None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("rows", [7, 256])
def test_points_move_to_where_the_pinhole_sees_them(monkeypatch, rows):
    monkeypatch.setattr(undistort, "ROWS", rows)
    points = np.array([[-0.4, -0.3, 1], [0.42, 0.31, 1], [0.4, -0.3, 1], [-0.1, 0.33, 1], [0, 0, 1]])
    photo = Photo(spots(LENS.project(points)), "a.png")
    result = undistort.undistorted(photo, LENS)
    y, x = np.mgrid[:240, :320] + 0.5
    for px, py in LENS.pinhole().project(points):
        weight = result.pixels[..., 0] * (np.hypot(x - px, y - py) < 9)
        assert (weight * x).sum() / weight.sum() == pytest.approx(px, abs=0.15)
        assert (weight * y).sum() / weight.sum() == pytest.approx(py, abs=0.15)


def test_a_pinhole_photo_is_left_alone():
    photo = Photo(spots([(10, 10)]), "a.png")
    assert undistort.undistorted(photo, LENS.pinhole()) is photo


def test_a_reduced_photo_keeps_its_full_size():
    photo = Photo(spots([(10, 10)]), "a.png", full_size=(640, 480))
    result = undistort.undistorted(photo, LENS.resized(640, 480))
    assert (result.width, result.height, result.pixels.shape) == (640, 480, (240, 320, 3))
