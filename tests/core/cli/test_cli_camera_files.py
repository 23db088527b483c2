"""Every command that takes cameras takes them in any layout, and says what of them is left out."""

import json
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.batch.keys import Refused
from core.batch.queries import find_queries
from core.cameras import colmap, nerfstudio
from core.cameras.files import camera_to_dict
from core.cli.commands.refine import pick_wanted
from core.cli.commands.render import _cameras
from core.errors import CameraError
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error

LENS = Intrinsics(64, 48, 60, 61, 30, 25, (0.05, -0.01, 0.001, 0.002, 0))
CAMERAS = [Camera(LENS, Pose(np.eye(3), np.array([0.1 * i, 0, 2])), f"{i}.png") for i in range(3)]


@pytest.fixture(params=["colmap", "transforms.json"])
def project(request, tmp_path):
    """A project folder: cameras in one of the layouts, and the photos in images/."""
    (tmp_path / "images").mkdir()
    for camera in CAMERAS:
        cv2.imwrite(str(tmp_path / "images" / camera.file), np.zeros((48, 64, 3), np.uint8))
    if request.param == "colmap":
        (tmp_path / "sparse" / "0").mkdir(parents=True)
        colmap.write_model(tmp_path / "sparse" / "0", CAMERAS)
        return tmp_path
    nerfstudio.write_transforms(tmp_path / "transforms.json", CAMERAS)
    return tmp_path / "transforms.json"


def test_a_single_photo_finds_its_camera(project):
    start = pick_wanted(project, Path("elsewhere/1.png"))
    assert start.intrinsics == LENS and pose_error(start.pose, CAMERAS[1].pose)[0] < 1e-12
    assert start.pixel_order == "stored"


def test_the_only_camera_of_a_file_is_taken_for_another_photo_with_a_word(tmp_path, capsys):
    nerfstudio.write_transforms(tmp_path / "transforms.json", CAMERAS[:1])
    for photo, said in (
        ("0.png", ""),
        ("sub/0.PNG", ""),
        ("7.png", "The one camera in 'transforms.json' is that of '0.png'; it is used for '7.png'."),
    ):
        pick_wanted(tmp_path / "transforms.json", Path(photo))
        assert capsys.readouterr().err.strip() == said


def test_render_takes_them(project):
    assert [camera.file for camera in _cameras(project)] == ["0.png", "1.png", "2.png"]


def test_batch_takes_them_and_finds_the_photos(project):
    args = Namespace(queries=project, start=None, focal=None, locate=False, poses=None)
    found = find_queries(args)
    folder = project if project.is_dir() else project.parent
    assert [photo.resolve() for photo in found.photos] == [folder.resolve() / "images" / camera.file for camera in CAMERAS]
    assert [replace(camera, pixel_order="upright").intrinsics for camera in found.cameras] == [LENS] * 3
    assert not found.notes


def test_what_is_left_out_is_said(tmp_path, capsys):
    frame = {"file_path": "a.png", "transform_matrix": np.eye(4).tolist()}
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps({"camera_model": "OPENCV_FISHEYE", "w": 64, "h": 48, "fl_x": 20, "frames": [frame]}))
    assert pick_wanted(file, Path("a.png")).wide.model == "OPENCV_FISHEYE"
    assert "sees more than 120 degrees: its photo is matched through pinhole cuts of it." in capsys.readouterr().err
    (middle,) = _cameras(file)
    assert middle.intrinsics.fx == pytest.approx(20) and not middle.intrinsics.has_distortion
    assert "The middle of the view is drawn" in capsys.readouterr().err
    file.write_text(json.dumps({"camera_model": "MEI", "w": 64, "h": 48, "fl_x": 20, "frames": [frame]}))
    with pytest.raises(CameraError, match=r"Camera 1 of 'transforms.json' has no lens of a known size"):
        _cameras(file)


GOOD = camera_to_dict(CAMERAS[1])
BAD = {
    "no lens": {"file": "0.png", "R": np.eye(3).tolist(), "t": [0, 0, 2], "width": 64},
    "no pose": {**GOOD, "file": "0.png", "t": [float("-inf"), 0, 0]},
    "no object": 7,
}


@pytest.mark.parametrize("case", BAD)
def test_one_bad_camera_leaves_the_others_usable(tmp_path, capsys, case):
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"frames": [BAD[case], GOOD, camera_to_dict(CAMERAS[2])]}))
    words = "1 camera of 'cameras.json' cannot be used and left out: Camera 1 of 'cameras.json'"
    assert [camera.file for camera in _cameras(file)] == ["1.png", "2.png"]
    assert words in capsys.readouterr().err
    assert pick_wanted(file, tmp_path / "1.png").file == "1.png"
    assert words in capsys.readouterr().err
    file.write_text(json.dumps({"frames": [BAD[case], GOOD]}))
    with pytest.raises(CameraError, match=r"1 camera, 0 of them for '0.png'.* Camera 1 of"):
        pick_wanted(file, tmp_path / "0.png")
    file.write_text(json.dumps({"frames": [BAD[case]]}))
    with pytest.raises(CameraError, match="Camera 1 of"):
        _cameras(file)


def test_render_leaves_out_a_camera_without_a_lens(tmp_path, capsys):
    file = tmp_path / "cameras.json"
    pose = {"file": "0.png", "R": np.eye(3).tolist(), "t": [0, 0, 2]}
    file.write_text(json.dumps({"frames": [pose, GOOD]}))
    assert [camera.file for camera in _cameras(file)] == ["1.png"]
    assert "Left out: 1 of 2 cameras. Camera 1 of 'cameras.json' has no lens" in capsys.readouterr().err


def test_batch_refuses_one_photo_whose_lens_is_none(tmp_path):
    """A lens in shares of the photo's size that no photo of this size can have."""
    row = "1,2,3,0,0,0"
    (tmp_path / "cameras.csv").write_text(f"#name,x,y,alt,heading,pitch,roll,f\n0.png,{row},0\n1.png,{row},28\n")
    for camera in CAMERAS[:2]:
        cv2.imwrite(str(tmp_path / camera.file), np.zeros((48, 64, 3), np.uint8))
    found = find_queries(Namespace(queries=tmp_path / "cameras.csv", start=None, focal=None, locate=False, poses=None))
    assert isinstance(found.cameras[0], Refused) and found.cameras[1].intrinsics.fx == pytest.approx(28 / 36 * 64)
