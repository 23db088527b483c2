"""Cameras of photos that EXIF turns: of the pixels as stored (COLMAP's), and of the upright ones."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.cameras import starts
from core.cameras.files import camera_from_dict, camera_to_dict
from core.cameras.unplaced import Unplaced
from core.errors import CameraError, PhotoError
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.geometry.lie import so3_exp
from core.geometry.turned_photo import stored_camera
from core.photos.fit import fit_camera, fit_lens
from core.photos.photo import Photo, photo_facts, read_photo

from ..support.photo_files import SHORT, encoded, exif

LENS = Intrinsics(64, 48, 50.0, 52.0, 30.0, 25.5, (0.05, -0.02, 0.003, -0.004, 0.01))
POSE = Pose(so3_exp(np.array([0.1, -0.2, 0.3])), np.array([0.2, -0.1, 3.0]))
POINTS = so3_exp(np.array([0.1, -0.2, 0.3])).T @ (np.random.default_rng(1).uniform(-0.6, 0.6, (3, 40)) - [[0.2], [-0.1], [0]])


def photo(orientation, size=(64, 48), file="a.jpg"):
    """A photo of that stored size, upright."""
    width, height = size[::-1] if orientation >= 5 else size
    return Photo(np.zeros((height, width, 3), np.uint8), file, orientation=orientation)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_a_point_lands_on_the_same_pixel_of_the_turned_photo(orientation):
    """The truth is OpenCV's: a dot painted into the stored picture, and found in what the reader makes of its file."""
    camera = Camera(LENS, POSE, "a.jpg", pixel_order="stored")
    fitted = fit_camera(photo(orientation), camera)
    for point in POINTS.T[:6]:
        at = LENS.project(POSE.transform(point[None]))[0]
        x, y = (int(v) for v in np.floor(at))
        assert 3 < x < 60 and 3 < y < 45
        stored = np.zeros((48, 64), np.uint8)
        stored[y, x] = 255
        turned = {1: stored, 3: cv2.rotate(stored, 1), 6: cv2.rotate(stored, 0), 8: cv2.rotate(stored, 2)}[orientation]
        row, column = np.argwhere(turned)[0]
        got = fitted.intrinsics.project(fitted.pose.transform(point[None]))[0]
        assert np.floor(got).tolist() == [column, row]
    assert fitted.pixel_order == "upright"
    np.testing.assert_allclose(fitted.pose.centre, POSE.centre, atol=1e-12)
    back = stored_camera(fitted, orientation)
    assert pose_error(back.pose, POSE)[1] < 1e-9 and back.intrinsics == LENS and back.pixel_order == "stored"


def test_the_reader_turns_as_these_cameras_do(tmp_path):
    stored = np.zeros((48, 64, 3), np.uint8)
    stored[2:10, 50:60] = 255
    for orientation, corner in {3: (38, 4), 6: (50, 38), 8: (4, 2)}.items():
        (tmp_path / "a.jpg").write_bytes(encoded(".jpg", stored, exif({0x0112: (SHORT, orientation)})))
        got = read_photo(tmp_path / "a.jpg")
        assert got.orientation == photo_facts(tmp_path / "a.jpg").orientation == orientation
        assert np.argwhere(got.pixels[..., 0] > 128).min(axis=0).tolist() == list(corner)


def test_sizes_decide_a_quarter_turn_whatever_the_file_says():
    upright = replace(LENS, width=48, height=64)
    assert fit_lens(photo(6), upright, "stored") == upright, "the camera of a copy that was turned before"
    assert fit_lens(photo(6), LENS, "upright").width == 48, "only the stored picture is as wide"
    assert fit_lens(photo(3), LENS, "upright") == LENS
    assert fit_lens(photo(3), LENS, "stored").cx == pytest.approx(64 - LENS.cx)
    square = replace(LENS, height=64)
    assert fit_lens(photo(6, (64, 64)), square) == square
    assert fit_lens(photo(6, (64, 64)), square, "stored").cy == pytest.approx(LENS.cx)
    half = fit_lens(photo(6), LENS.resized(128, 96))
    assert (half.width, half.height) == (48, 64)


def test_a_mirrored_photo_is_refused_with_a_camera_of_its_stored_pixels():
    assert fit_lens(photo(2), LENS) == LENS
    for orientation in (2, 4, 5, 7):
        with pytest.raises(PhotoError, match="stored mirrored"):
            fit_lens(photo(orientation), LENS, "stored")


def test_the_sources_convention_goes_with_their_cameras(tmp_path):
    model = tmp_path / "model"
    model.mkdir()
    (model / "cameras.txt").write_text("1 OPENCV 64 48 50 52 30 25.5 0.05 -0.02 0.003 -0.004\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 3 1 a.jpg\n\n")
    (start,) = starts(model).placed
    assert start.pixel_order == "stored"
    nerf = {"w": 64, "h": 48, "fl_x": 50, "cx": 30, "cy": 25, "frames": [{"file_path": "a.jpg", "transform_matrix": [
        [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}]}  # fmt: skip
    (tmp_path / "transforms.json").write_text(json.dumps(nerf))
    assert starts(tmp_path / "transforms.json").placed[0].pixel_order == "stored"
    assert fit_camera(photo(3), start.camera(LENS)).intrinsics.cx == pytest.approx(64 - 30)
    without_lens = replace(start, intrinsics=None).camera(fit_lens(photo(6), LENS), 6)
    assert pose_error(fit_camera(photo(6), without_lens).pose, fit_camera(photo(6), start.camera(LENS)).pose)[1] < 1e-9


def test_camera_json_says_which_pixels_it_belongs_to():
    camera = Camera(LENS, POSE, "a.jpg", pixel_order="stored")
    record = camera_to_dict(camera)
    assert record["orientation"] == "stored" and camera_from_dict(record).pixel_order == "stored"
    assert "orientation" not in camera_to_dict(replace(camera, pixel_order="upright"))
    assert Unplaced.of(camera).pixel_order == "stored"
    with pytest.raises(CameraError, match='neither "upright" nor "stored"'):
        camera_from_dict({**record, "orientation": 3})
