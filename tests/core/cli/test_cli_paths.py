"""No command writes over what it reads, however that is spelt."""

import os
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from cli_place import FAST, Place

from core.cli.main import main
from core.render import Renderer, RenderSettings
from core.splats import read_splats
from core.splats.ply.reader import write_ply


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"), photos=1)


@pytest.fixture
def files(place, tmp_path):
    """A folder of one's own with everything in it."""
    for path in (place.scene, place.folder / "photo_0.png"):
        shutil.copy(path, tmp_path)
    shutil.copy(tmp_path / "photo_0.png", tmp_path / "mask.png")
    place.json(tmp_path / "cam.json", place.starts)
    os.link(tmp_path / "photo_0.png", tmp_path / "hard.png")
    (tmp_path / "sub").mkdir()
    return tmp_path


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def refused(files, capsys, *argv):
    before = contents(files)
    assert main([str(a) for a in argv]) == 2
    captured = capsys.readouterr()
    assert contents(files) == before
    assert captured.out == ""
    return captured.err.splitlines()[-1]


@pytest.mark.parametrize("target", ["photo_0.png", "scene.ply", "cam.json", "mask.png", "sub/../photo_0.png", "hard.png"])
def test_batch_and_refine(files, capsys, target):
    mask = ["--mask", files / "mask.png"]
    batch = ["batch", files / "scene.ply", files / "cam.json", *mask, *FAST]
    refine = ["refine", files / "scene.ply", files / "photo_0.png", "--camera", files / "cam.json", *mask, *FAST]
    for argv in (
        [*batch, "--out", files / target],
        [*batch, "--out", files / "new.json", "--poses", files / target],
        [*refine, "--out", files / target],
    ):
        assert "would overwrite" in refused(files, capsys, *argv)


def test_poses_and_results_in_one_file(files, capsys):
    argv = ["batch", files / "scene.ply", files / "cam.json", "--out", files / "r.json", "--poses", files / "sub/../r.json"]
    assert "would overwrite what --out writes" in refused(files, capsys, *argv)


def test_render_into_the_folder_of_the_photos(files, capsys):
    said = refused(files, capsys, "render", files / "scene.ply", files / "cam.json", files)
    assert "would overwrite a photo" in said
    assert main(["render", str(files / "scene.ply"), str(files / "cam.json"), str(files / "sub")]) == 0
    assert main(["render", str(files / "scene.ply"), str(files / "cam.json"), str(files / "sub")]) == 0  # its own may go


def test_convert_onto_itself(files, capsys):
    assert "would overwrite the cameras" in refused(files, capsys, "convert", files / "cam.json", files / "cam.json")
    assert main(["convert", str(files / "cam.json"), str(files / "model")]) == 0
    (files / "model" / "points3D.txt").write_text("1 0 0 0 255 255 255 0.1 1 0\n")
    capsys.readouterr()
    for source in ("model", "model/images.txt"):
        assert "would overwrite the cameras" in refused(files, capsys, "convert", files / source, files / "model")


def test_demo_in_a_folder_with_files_of_its_names(files, capsys):
    (files / "photo.jpg").write_bytes((files / "photo_0.png").read_bytes())
    assert "has the file 'photo.jpg', which no demo wrote" in refused(files, capsys, "demo", "--out", files)


# ---- the near plane


def test_render_draws_what_a_refinement_sees(place, tmp_path):
    """A scan of a thimble, whose front lies nearer than 0.2 of its units."""
    scene = read_splats(place.scene)
    write_ply(tmp_path / "small.ply", replace(scene, means=scene.means * 0.01, scales=scene.scales * 0.01))
    small, camera = read_splats(tmp_path / "small.ply"), place.truths[0]
    camera = replace(camera, pose=replace(camera.pose, t=camera.pose.t * 0.01))
    cam = place.json(tmp_path / "cam.json", [camera])
    assert main(["render", str(tmp_path / "small.ply"), cam, str(tmp_path / "out"), "--npz", "--threads", "1"]) == 0
    drawn = np.load(tmp_path / "out" / "photo_0.npz")
    seen = Renderer(small, RenderSettings.for_scene(small, 1)).render(camera.intrinsics, camera.pose)
    np.testing.assert_array_equal(drawn["color"], seen.color)
    assert drawn["alpha"].max() > 0.9
    argv = ["render", str(tmp_path / "small.ply"), cam, str(tmp_path / "far"), "--near", "0.2"]
    assert main(argv) == 0
    assert cv2.imread(str(tmp_path / "far" / "photo_0.png")).max() == 0  # all of it is nearer


NEAR = {"0": "--near is 0", "-1": "--near is -1", "nan": "--near: 'nan' is no number", "inf": "--near: 'inf' is no number"}


@pytest.mark.parametrize("near", NEAR)
def test_a_near_plane_that_is_none_is_refused(files, capsys, near):
    said = refused(files, capsys, "render", files / "scene.ply", files / "cam.json", files / "sub", "--near", near)
    assert said.startswith(NEAR[near])
