"""`convert`, and nerfstudio's two worlds: a splat keeps its place in the picture when it and the cameras move together."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_files import put

from core.cameras import read, starts
from core.cameras.files import camera_to_dict, read_cameras, read_starts, write_cameras
from core.cameras.nerfstudio import write_transforms
from core.cameras.training_world import read_training_world
from core.cli.main import main
from core.errors import DatasetError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.geometry.lie import so3_exp

LENS = Intrinsics(640, 480, 500.0, 510.0, 321.0, 239.0, (0.01, -0.02, 0.001, 0.002, 0.0))
CAMERAS = [Camera(LENS, Pose(so3_exp([0.1 * i, -0.3, 0.2]), np.array([0.5, -i, 2.0])), f"images/{i}.jpg") for i in range(3)]
TURN, SHIFT, SCALE = so3_exp([0.4, 1.1, -0.7]), np.array([3.0, -2.0, 5.0]), 0.17
POINTS = np.random.default_rng(0).normal([0, 0, 6], 1, (50, 3))


@pytest.fixture
def world(tmp_path):
    """As nerfstudio writes it: p_splat = scale * (R p + t)."""
    transform = np.column_stack([TURN, SHIFT]).tolist()
    return put(tmp_path / "dataparser_transforms.json", json.dumps({"transform": transform, "scale": SCALE}))


def run(capsys, *argv):
    code = main([str(a) for a in ("convert", *argv)])
    return code, capsys.readouterr().err


def test_cameras_follow_the_splat_into_its_training_world(tmp_path, capsys, world):
    """Points moved by nerfstudio's formula, and seen by the converted cameras, lie on the pixels where they lay before."""
    write_transforms(tmp_path / "transforms.json", CAMERAS)
    out = tmp_path / "splat_cameras.json"
    assert run(capsys, tmp_path / "transforms.json", out, "--into-training-world", world) == (0, "")
    trained = SCALE * (POINTS @ TURN.T + SHIFT)
    for before, after in zip(CAMERAS, read_cameras(out), strict=True):
        pixels = after.intrinsics.project(after.pose.transform(trained))
        np.testing.assert_allclose(pixels, before.intrinsics.project(before.pose.transform(POINTS)), atol=1e-6)
        assert after.file == before.file


def test_and_back_out_of_it(tmp_path, capsys, world):
    write_cameras(tmp_path / "a.json", CAMERAS)
    assert run(capsys, tmp_path / "a.json", tmp_path / "b.json", "--into-training-world", world)[0] == 0
    again = tmp_path / "transforms.json"
    assert run(capsys, tmp_path / "b.json", again, "--to", "nerfstudio", "--out-of-training-world", world)[0] == 0
    for before, after in zip(CAMERAS, read(again).frames, strict=True):
        np.testing.assert_allclose(after.pose.R, before.pose.R, atol=1e-9)
        np.testing.assert_allclose(after.pose.t, before.pose.t, atol=1e-9)


@pytest.mark.parametrize("out", ["c.json", "c.txt", "model"])
def test_every_layout_holds_the_same_poses(tmp_path, capsys, out):
    write_cameras(tmp_path / "a.json", CAMERAS)
    assert run(capsys, tmp_path / "a.json", tmp_path / out) == (0, "")
    for before, after in zip(CAMERAS, starts(tmp_path / out).placed, strict=True):
        np.testing.assert_allclose(after.pose.R, before.pose.R, atol=1e-9)
        np.testing.assert_allclose(after.pose.t, before.pose.t, atol=1e-9)
        assert after.file == before.file and after.intrinsics in (None if out == "c.txt" else before.intrinsics, LENS)


def test_poses_without_a_lens_stay_without_one(tmp_path, capsys):
    poses = put(tmp_path / "poses.txt", "a.png 1 0 0 0 1 2 3\n")
    assert run(capsys, poses, tmp_path / "a.json")[0] == 0
    (start,) = read_starts(tmp_path / "a.json")
    assert start.intrinsics is None and start.pose.t.tolist() == [1, 2, 3]
    code, err = run(capsys, poses, tmp_path / "model")
    assert code == 2 and "has no lens" in err and not (tmp_path / "model").exists()


def test_an_ending_that_tells_nothing_is_asked_about(tmp_path, capsys):
    code, err = run(capsys, put(tmp_path / "p.txt", "a.png 1 0 0 0 1 2 3\n"), tmp_path / "out.xyz")
    assert code == 2 and "--to" in err and "Traceback" not in err


ROWS = np.column_stack([TURN, SHIFT])


@pytest.mark.parametrize(
    "data",
    [
        {},
        [],
        {"transform": ROWS.tolist()},
        {"transform": ROWS.tolist(), "scale": 0},
        {"transform": ROWS.tolist(), "scale": -1},
        {"transform": ROWS.tolist(), "scale": float("nan")},
        {"transform": ROWS[:2].tolist(), "scale": 1},
        {"transform": (ROWS * [[1], [1], [2]]).tolist(), "scale": 1},
        {"transform": "x", "scale": 1},
        {"transform": ROWS.tolist(), "scale": [1]},
    ],
)
def test_a_damaged_world_file_is_refused(tmp_path, data):
    with pytest.raises(DatasetError, match="dataparser_transforms"):
        read_training_world(put(tmp_path / "dataparser_transforms.json", json.dumps(data)))


def track_file(tmp_path, files):
    """A track of the cameras, at the frames 1001 and on."""
    records = [
        {**camera_to_dict(replace(c, file=f)), "frame": 1001 + i} for i, (c, f) in enumerate(zip(CAMERAS, files, strict=True))
    ]
    return put(tmp_path / "t.json", json.dumps({"frames": records}))


SEQUENCE = [f"/plates/shot.{1001 + i}.exr" for i in range(3)]


@pytest.mark.parametrize("files", [SEQUENCE, 3 * ["/plates/shot.mov"]], ids=["sequence", "movie"])
@pytest.mark.parametrize("out", ["transforms.json", "c.txt", "model"])
def test_a_track_goes_into_every_layout_with_a_picture_for_each_frame(tmp_path, capsys, files, out):
    code, said = run(capsys, track_file(tmp_path, files), tmp_path / out)
    assert code == 0
    frames = read(tmp_path / out).frames
    for frame, camera, file in zip(frames, CAMERAS, files, strict=True):
        np.testing.assert_allclose(frame.pose.t, camera.pose.t, atol=1e-9)
        assert frame.name.endswith(Path(file).name) or "The frames of the movie are named 'shot.1001.png'" in said
    assert len({frame.name for frame in frames}) == 3
    if out == "transforms.json":
        assert "transform_matrix" in json.loads((tmp_path / out).read_text())["frames"][0]


@pytest.mark.parametrize("files", [SEQUENCE, 3 * ["/plates/shot.mov"]], ids=["sequence", "movie"])
def test_a_track_goes_into_a_chan_file(tmp_path, capsys, files):
    code, said = run(capsys, track_file(tmp_path, files), tmp_path / "a.chan")
    assert code == 0 and "A .chan file does not hold the distortion" in said
    lines = np.loadtxt(tmp_path / "a.chan")
    assert lines[:, 0].tolist() == [1001, 1002, 1003]
    np.testing.assert_allclose(lines[:, 1:4], [camera.pose.centre for camera in CAMERAS], atol=1e-7)


def test_cameras_of_no_frames_make_no_chan_file(tmp_path, capsys):
    write_cameras(tmp_path / "a.json", [replace(camera, file="photo.jpg") for camera in CAMERAS[:1]])
    code, said = run(capsys, tmp_path / "a.json", tmp_path / "a.chan")
    assert code == 2 and "are not those of numbered frames" in said


def test_transforms_json_is_nerfstudios_unless_it_is_said_otherwise(tmp_path, capsys):
    write_cameras(tmp_path / "a.json", CAMERAS)
    assert run(capsys, tmp_path / "a.json", tmp_path / "transforms.json")[0] == 0
    assert "fl_x" in json.loads((tmp_path / "transforms.json").read_text())
    assert run(capsys, tmp_path / "a.json", tmp_path / "transforms.json", "--to", "json")[0] == 0
    assert "R" in json.loads((tmp_path / "transforms.json").read_text())["frames"][0]
