"""Corners followed into neighbouring renders of the ray-cast room: their places against exact geometry, masks, empty photos."""

from dataclasses import replace

import numpy as np
import pytest
from boxroom import BoxRoom

from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.photos.photo import Photo
from core.pose.final.guided import PosedRender, follow, match_corners, pick_corners
from core.pose.shared.matches import bearings
from core.pose.shared.surface import sample
from core.pose.shared.working import WorkingPhoto

LENS = Intrinsics(320, 240, 260.0, 258.0, 163.0, 118.0, (-0.08, 0.02, 0.001, -0.0005, 0.0))
TRUTH = Pose.from_centre(so3_exp([0.05, 0.2, 0.02]), [-0.4, 0.1, -2.6])
NEARLY = Pose.from_centre(so3_exp([0.001, -0.001, 0.0]) @ TRUTH.R, TRUTH.centre + 0.004)
BESIDE = Pose.from_centre(so3_exp([0.0, 0.01, 0.0]) @ TRUTH.R, TRUTH.centre + np.array([0.15, -0.05, 0.05]))


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


@pytest.fixture(scope="module")
def photo(room):
    return WorkingPhoto.of(room.photo(LENS, TRUTH), LENS, 640)


def test_followed_corners_lie_where_geometry_says(room, photo):
    corners = pick_corners(photo, NEARLY, room.render(photo.pinhole, NEARLY))
    matches = follow(room, photo, NEARLY, BESIDE, corners)
    exact = room.render(photo.pinhole, TRUTH)  # the depth of the photo's own pixels
    pixels = matches.query * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy)
    world = (bearings(matches.query) * sample(exact.depth, pixels)[:, None] - TRUTH.t) @ TRUTH.R
    want = photo.pinhole.project(BESIDE.transform(world))
    error = np.linalg.norm(matches.view * (LENS.fx, LENS.fy) + (LENS.cx, LENS.cy) - want, axis=1)
    assert len(matches) > 100 and not matches.reference
    assert np.median(error) < 0.15 and np.mean(error < 1.0) > 0.9
    np.testing.assert_allclose(np.median(matches.depth / BESIDE.transform(world)[:, 2]), 1.0, atol=2e-3)


def test_corners_stay_out_of_the_mask(room):
    whole = room.photo(LENS, TRUTH)
    mask = np.ones((240, 320), bool)
    mask[:, :160] = False
    photo = WorkingPhoto.of(replace(whole, mask=mask), LENS, 640)
    corners = pick_corners(photo, TRUTH, room.render(photo.pinhole, TRUTH))
    distorted = LENS.project(bearings(photo.pinhole.normalise(corners.pixels)))
    assert len(corners.pixels) > 30 and distorted[:, 0].min() > 160


def test_a_plain_photo_has_no_corners_and_no_matches(room):
    plain = WorkingPhoto.of(Photo(np.full((240, 320, 3), 90, np.uint8)), LENS, 640)
    view = room.render(plain.pinhole, TRUTH)
    corners = pick_corners(plain, TRUTH, view)
    assert corners.pixels.shape == (0, 2) and corners.world.shape == (0, 3)
    assert len(match_corners(PosedRender(view, TRUTH, reference=True), plain, TRUTH, corners)) == 0


def test_sampling_is_bilinear_between_pixel_centres():
    image = np.arange(12, dtype=np.float32).reshape(3, 4)
    np.testing.assert_allclose(sample(image, np.array([[0.5, 0.5], [2.0, 1.5], [1.5, 2.0]])), [0.0, 5.5, 7.0])


def test_another_lens_makes_another_straight_photo(photo):
    again = photo.with_intrinsics(replace(LENS, dist=(0.0,) * 5))
    np.testing.assert_array_equal(again.grey, photo.raw)
    assert photo.with_intrinsics(LENS).grey.tolist() == photo.grey.tolist()


def test_a_tiny_photo_is_no_accident(room):
    """Windows that shrink with the photo must stay ones that OpenCV takes."""
    small = LENS.resized(40, 30)
    photo = WorkingPhoto.of(room.photo(small, TRUTH), small, 640)
    view = room.render(photo.pinhole, TRUTH)
    matches = match_corners(PosedRender(view, TRUTH, reference=True), photo, TRUTH, pick_corners(photo, TRUTH, view))
    assert np.isfinite(matches.view).all()
