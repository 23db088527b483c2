"""Cameras in the world of the training beside a splat file with other axes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_place import FAST, Place
from ply_files import ply_bytes, raw_table

from core.cameras.files import read_cameras
from core.cameras.training_world import ScanAxes, training_turns
from core.cli.main import main
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.geometry.conventions import Similarity
from core.geometry.lie import so3_exp
from core.splats import GaussianScene, read_splats
from core.splats.spz.write import write_spz

# raw_table(24, 1, seed=5) as splat-transform 2.7.1 writes it.
THEIRS = Path(__file__).parents[2] / "data" / "by_splat_transform.glb"
LENS = Intrinsics(64, 48, 60, 60, 32, 24)
HALF_TURN_X = Similarity(1.0, np.diag([1.0, -1.0, -1.0]), np.zeros(3))


def turned(camera):
    return replace(camera, pose=HALF_TURN_X.pose_to_scene(camera.pose))


def aside(count=500, orientation="Y_UP"):
    """A heap of Gaussians well off the origin, which a camera that looks at it loses when the world turns under it."""
    rng = np.random.default_rng(1)
    means = (rng.normal(size=(count, 3)) * 0.3 + (1, 4, 6)).astype(np.float32)
    rotations = np.tile(np.float32([1, 0, 0, 0]), (count, 1))
    arrays = (means, np.full((count, 3), 0.1, np.float32), rotations, np.full(count, 0.5, np.float32))
    return GaussianScene(*arrays, np.zeros((count, 1, 3), np.float32), orientation=orientation)


LOOKING = Camera(LENS, Pose.from_centre(np.eye(3), (1, 4, 2)), "a.png")


def test_the_turn_is_that_of_the_file_itself(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(24, 1, seed=5)))
    ours = read_splats(tmp_path / "a.ply")
    write_spz(tmp_path / "a.spz", ours)
    for file in (tmp_path / "a.spz", THEIRS):
        other = read_splats(file)
        first = training_turns(other.orientation, other.format)[0]
        np.testing.assert_allclose(first.to_scene(ours.means), other.means, atol=1e-3)
    assert training_turns("Y_DOWN") == ()


@pytest.mark.parametrize("asked", ["auto", "file", "training"])
def test_cameras_that_see_the_scan_where_they_are_stay(asked):
    cameras, sentence = ScanAxes.of(aside(orientation="Y_DOWN")).settled([LOOKING], asked)
    assert cameras == [LOOKING] and not sentence
    if asked != "training":
        cameras, sentence = ScanAxes.of(aside()).settled([LOOKING], asked)
        assert cameras == [LOOKING] and not sentence


def test_cameras_that_see_nothing_are_taken_out_of_the_world_of_the_training():
    scan, training = ScanAxes.of(aside()), turned(LOOKING)
    assert (scan.share_seen(LOOKING.pose, LENS), scan.share_seen(training.pose, LENS)) == (pytest.approx(1, abs=0.05), 0)
    (camera,), sentence = scan.settled([training], "auto")
    assert pose_error(camera.pose, LOOKING.pose)[0] < 1e-12
    assert sentence.startswith("In the world of the training, y down") and sentence.endswith("show the scan.")
    assert scan.settled([training], "file") == ([training], "")
    (camera,), sentence = scan.settled([training], "training")
    assert pose_error(camera.pose, LOOKING.pose)[0] < 1e-12 and not sentence
    (back,) = scan.into_training_world([LOOKING])
    assert pose_error(back.pose, training.pose)[0] < 1e-12


def test_cameras_that_see_nothing_anywhere_stay():
    away = replace(LOOKING, pose=Pose.from_centre(so3_exp(np.array([0, np.pi, 0])), (500, 0, 0)))
    assert ScanAxes.of(aside()).settled([away], "auto") == ([away], "")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The place of the command line's tests, its scan as .ply and as .spz."""
    made = Place(tmp_path_factory.mktemp("place"), photos=1)
    write_spz(made.folder / "scene.spz", read_splats(made.scene))
    made.json(made.folder / "cameras.json", made.starts)
    return made


def refined(place, scene, tmp_path, *more):
    out, photo = tmp_path / "r.json", place.folder / place.truths[0].file
    argv = ["refine", place.folder / scene, photo, "--camera", place.folder / "cameras.json", "--out", out, "--no-locate"]
    assert main([*map(str, argv), *FAST, *more]) in (0, 3)
    return json.loads(out.read_text()), read_cameras(out)[0]


def test_a_photo_beside_an_spz_is_refined_from_the_camera_of_colmap(place, tmp_path, capsys):
    """Its result is that beside the .ply, in the coordinates of the .spz."""
    record, ply = refined(place, "scene.ply", tmp_path)
    assert record["verdict"] == "trusted"
    size = np.linalg.norm(place.truths[0].pose.centre)
    for more in ((), ("--axes", "training")):
        record, spz = refined(place, "scene.spz", tmp_path, *more)
        assert record["verdict"] == "trusted"
        distance, degrees = pose_error(turned(spz).pose, ply.pose)
        assert (distance < 2e-3 * size, degrees < 0.1) == (True, True)
    assert refined(place, "scene.spz", tmp_path, "--axes", "file")[0]["verdict"] == "failed"


def test_it_is_drawn_and_converted_in_the_coordinates_of_the_file(place, tmp_path, capsys):
    at = {name: str(place.folder / name) for name in ("scene.ply", "scene.spz", "cameras.json")}
    world = ["--axes", "training"]
    assert main(["convert", at["cameras.json"], str(tmp_path / "c.json"), "--scan", at["scene.spz"], *world]) == 0
    assert pose_error(read_cameras(tmp_path / "c.json")[0].pose, turned(place.starts[0]).pose)[0] < 1e-9
    back = ["--axes", "file", "--to-axes", "training", "--scan", at["scene.spz"]]
    assert main(["convert", str(tmp_path / "c.json"), str(tmp_path / "d.json"), *back]) == 0
    assert pose_error(read_cameras(tmp_path / "d.json")[0].pose, place.starts[0].pose)[0] < 1e-9
    assert main(["convert", at["cameras.json"], str(tmp_path / "e.json"), *world]) == 2
    assert "give it with --scan" in capsys.readouterr().err
    for name, more in (("scene.ply", []), ("scene.spz", world)):
        assert main(["render", at[name], at["cameras.json"], str(tmp_path / name), "--npz", *more]) == 0
    ply, spz = (np.load(tmp_path / name / "photo_0.npz")["color"] for name in ("scene.ply", "scene.spz"))
    assert np.abs(ply - spz).mean() < 0.01


def test_a_batch_says_once_that_its_starts_had_other_axes(place, tmp_path, capsys):
    argv = ["batch", place.folder / "scene.spz", place.folder / "cameras.json", "--out", tmp_path / "r.json", "--workers", "1"]
    assert main([*map(str, argv), "--no-locate", *FAST]) == 0
    assert capsys.readouterr().err.count("In the world of the training, y down, not in the coordinates") == 1
