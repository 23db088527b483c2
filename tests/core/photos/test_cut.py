"""Photos cut into pinhole pictures, against the same room ray-cast through those pinholes."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from boxroom import BoxRoom
from wide_photos import cast_photo, fisheye_lens, fisheye_rays, panorama_rays

from core.errors import PhotoError
from core.geometry.camera import Pose
from core.geometry.lie import so3_exp
from core.geometry.pinhole_cut import WideCamera, central_cut, cuts_of
from core.geometry.wide_lens import WideLens
from core.photos.fit import fit_camera, fit_wide_camera
from core.photos.wide.cut import cut_photo

POSE = Pose.from_centre(so3_exp([0.05, 0.2, 0.02]), [-0.4, 0.1, -1.0])


@pytest.fixture(scope="module")
def room():
    return BoxRoom()


def mean_difference(room, made, blur=2.5):
    """Mean difference (0..255) between a cut and the ray-cast photo of its pinhole, of what both can resolve."""
    true = room.photo(made.cut.intrinsics, made.cut.pose(POSE), noise=0).pixels
    one, other = (cv2.GaussianBlur(picture.astype(np.float32), (0, 0), blur) for picture in (made.photo.pixels, true))
    return np.abs(one - other).mean()


def test_a_fisheye_cut_is_the_pinholes_own_photo(room):
    lens = fisheye_lens(360)
    photo = cast_photo(room, fisheye_rays(lens, 2), (360, 360), POSE)
    made = cut_photo(photo, lens, central_cut(lens))
    assert made.photo.mask is None and made.photo.file == photo.file
    assert mean_difference(room, made) < 1
    moved = replace(made, cut=replace(made.cut, intrinsics=replace(made.cut.intrinsics, cx=made.cut.intrinsics.cx + 1)))
    assert mean_difference(room, moved) > 5  # what a pixel off would be


def test_the_faces_of_a_panorama_are_the_pinholes_own_photos(room):
    lens = WideLens.panorama(640, 320)
    photo = cast_photo(room, panorama_rays(640, 2), (320, 640), POSE)
    for cut in cuts_of(lens):
        made = cut_photo(photo, lens, cut)
        assert made.photo.mask is None
        assert mean_difference(room, made) < 1, cut.name


def test_what_the_photo_does_not_show_is_masked_and_left_out(room):
    lens = fisheye_lens(240)
    photo = cast_photo(room, fisheye_rays(lens, 2), (240, 240), POSE)
    x, y = np.meshgrid(np.arange(240), np.arange(240))
    seen = (x > 100) & (y < 180) & (x - y < 90)
    whole = central_cut(lens)
    made = cut_photo(replace(photo, mask=seen), lens, whole)
    k = made.cut.intrinsics
    assert k.width < whole.intrinsics.width and k.height < whole.intrinsics.height
    assert made.photo.mask.shape == (k.height, k.width) == made.photo.pixels.shape[:2]
    v, u = np.nonzero(made.photo.mask)
    at = lens.project(np.column_stack([(u + 0.5 - k.cx) / k.fx, (v + 0.5 - k.cy) / k.fy, np.ones(len(u))]))
    assert seen[tuple(np.floor(at[:, ::-1]).astype(int).T)].all()
    assert made.photo.mask.any(axis=0).all() and made.photo.mask.any(axis=1).all()
    with pytest.raises(PhotoError, match="shows nothing where its lens looks"):
        cut_photo(replace(photo, mask=np.zeros((240, 240), bool)), lens, whole)


def test_a_turned_photos_camera_is_turned_and_resized(room):
    stored = WideCamera.of(replace(fisheye_lens(400), width=480, cx=230.0), POSE, "p.jpg", "stored")
    photo = cast_photo(room, fisheye_rays(fisheye_lens(80), 2), (80, 80), POSE)
    photo = replace(photo, orientation=6, full_size=(200, 240))
    fitted = fit_wide_camera(photo, stored)
    assert (fitted.lens.width, fitted.lens.height, fitted.pixel_order) == (200, 240, "upright")
    assert (fitted.lens.cx, fitted.lens.cy) == pytest.approx((100, 115))
    point = POSE.inverse().transform([[0.3, 0.2, 1.0]])
    u, v = stored.lens.project(POSE.transform(point))[0]
    np.testing.assert_allclose(fitted.lens.project(fitted.pose.transform(point))[0], [(400 - v) / 2, u / 2], atol=1e-9)
    with pytest.raises(PhotoError, match="lens OPENCV_FISHEYE, which has to be cut into pinhole pictures; place it with"):
        fit_camera(photo, stored)
