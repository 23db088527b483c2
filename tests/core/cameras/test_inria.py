"""The cameras.json that INRIA's training leaves beside a splat, and finding it there."""

import json
import logging

import numpy as np
import pytest

from core.cameras import detect, read
from core.errors import DatasetError
from core.locate.known_cameras import cameras_beside, read_known
from core.synthetic import sample_cameras

CAMERAS = sample_cameras(3)


def records():
    """What camera_to_JSON of the training code writes: the inverse of world-to-camera, its last column as the position."""
    out = []
    for number, camera in enumerate(CAMERAS):
        world_to_camera = np.eye(4)
        world_to_camera[:3, :3], world_to_camera[:3, 3] = camera.pose.R, camera.pose.t
        back, k = np.linalg.inv(world_to_camera), camera.intrinsics
        out.append(
            {
                "id": number,
                "img_name": f"photo_{number}",
                "width": k.width,
                "height": k.height,
                "position": back[:3, 3].tolist(),
                "rotation": [row.tolist() for row in back[:3, :3]],
                "fy": k.fy,
                "fx": k.fx,
            }
        )
    return out


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


def test_poses_and_lenses_come_back(tmp_path):
    path = write(tmp_path / "cameras.json", records())
    assert detect(path) == "inria"
    found = read(path).frames
    assert [frame.name for frame in found] == ["photo_0", "photo_1", "photo_2"]
    for frame, camera in zip(found, CAMERAS, strict=True):
        assert np.allclose(frame.pose.R, camera.pose.R, atol=1e-9)
        assert np.allclose(frame.pose.t, camera.pose.t, atol=1e-9)
        assert (frame.intrinsics.fx, frame.intrinsics.width) == (camera.intrinsics.fx, camera.intrinsics.width)
        assert frame.intrinsics.cx == camera.intrinsics.width / 2


@pytest.mark.parametrize(
    "change",
    [
        {"img_name": 3},
        {"position": [0, 1]},
        {"position": [0, 1, float("nan")]},
        {"rotation": [[1, 0, 0], [0, 1, 0]]},
        {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]},
        {"rotation": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]},
        {"rotation": "none"},
    ],
)
def test_a_damaged_camera_is_one_sentence(tmp_path, change):
    damaged = records()
    damaged[1] |= change
    with pytest.raises(DatasetError, match=r"^Camera 2 of 'cameras.json' .*anew\.$"):
        read(write(tmp_path / "cameras.json", damaged))


def test_a_lens_that_is_none_leaves_the_pose(tmp_path):
    odd = records()
    odd[0]["fx"] = 0
    assert read(write(tmp_path / "cameras.json", odd)).frames[0].intrinsics is None


def test_the_cameras_of_a_training_are_found_from_its_splat(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    scan = tmp_path / "point_cloud" / "iteration_30000" / "point_cloud.ply"
    scan.parent.mkdir(parents=True)
    assert cameras_beside(scan) is None
    path = write(tmp_path / "cameras.json", records())
    place, found = cameras_beside(scan)
    assert place == path
    assert [camera.file for camera in found] == ["photo_0", "photo_1", "photo_2"]
    assert "known cameras read from" in caplog.text


def test_cameras_of_nerfstudio_are_taken_into_the_world_of_the_splat(tmp_path):
    matrix = np.eye(4).tolist()
    write(tmp_path / "transforms.json", {"frames": [{"file_path": "a.jpg", "transform_matrix": matrix}]})
    assert np.allclose(cameras_beside(tmp_path / "splat.ply")[1][0].pose.centre, 0)
    write(tmp_path / "dataparser_transforms.json", {"transform": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 0.5})
    assert np.allclose(cameras_beside(tmp_path / "splat.ply")[1][0].pose.centre, [1, 0, 0])


def test_other_json_beside_a_scan_is_no_cameras_and_damaged_cameras_are_said(tmp_path, caplog):
    write(tmp_path / "cameras.json", {"frames": []})
    assert cameras_beside(tmp_path / "splat.ply") is None
    damaged = records()
    for record in damaged:
        record["position"] = None
    write(tmp_path / "cameras.json", damaged)
    assert cameras_beside(tmp_path / "splat.ply") is None
    assert "cannot be used" in caplog.text


def test_one_bad_known_camera_leaves_the_others_usable(tmp_path, caplog):
    record = {
        "img_name": "a",
        "width": 64,
        "height": 48,
        "position": [0, 0, 0],
        "rotation": np.eye(3).tolist(),
        "fx": 50,
        "fy": 50,
    }
    (tmp_path / "cameras.json").write_text(json.dumps([record, {**record, "img_name": "b", "position": None}]))
    assert [camera.file for camera in read_known(tmp_path / "cameras.json")] == ["a"]
    assert "1 camera of 'cameras.json' cannot be used and left out: Camera 2 of 'cameras.json'" in caplog.text
    ours = {"file": "a", "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    (tmp_path / "ours.json").write_text(json.dumps([{**ours, "R": 3}, ours]))
    assert len(read_known(tmp_path / "ours.json")) == 1 and "Camera 1 of 'ours.json'" in caplog.text
