"""The built-in sample: a scene worth showing, a photo that differs from any render, and the demo that brings it home."""

import json
from dataclasses import replace

import numpy as np
import pytest

from core.cameras.files import read_cameras
from core.cli.main import main
from core.geometry.camera import pose_error
from core.pictures.chessboard import before_after, chessboard
from core.pose.refine import refine
from core.render import Renderer, RenderSettings
from core.splats import read_splats
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras, write_sample

pytestmark = pytest.mark.loop


@pytest.fixture(scope="module")
def scene():
    return make_scene()


@pytest.fixture(scope="module")
def renderer(scene):
    return Renderer(scene, RenderSettings(threads=1))


def test_the_room_has_about_forty_thousand_sound_gaussians(scene):
    assert len(scene) == pytest.approx(40_000, rel=0.05)
    assert scene.sh_degree == 1
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1, atol=1e-5)
    assert all(np.isfinite(a).all() for a in (scene.means, scene.scales, scene.sh)) and (scene.scales > 0).all()


def test_the_count_follows_the_wish_and_the_seed_fixes_it_all():
    a, b, other = make_scene(1, 8_000), make_scene(1, 8_000), make_scene(2, 8_000)
    assert len(a) == pytest.approx(8_000, rel=0.1)
    np.testing.assert_array_equal(a.means, b.means)
    np.testing.assert_array_equal(a.sh, b.sh)
    assert len(other) != len(a) or not np.array_equal(other.sh, a.sh)


def test_every_sample_camera_stands_in_the_room_and_sees_it(renderer):
    for camera in sample_cameras():
        small = camera.intrinsics.pinhole().resized(160, 120)
        view = renderer.render(small, camera.pose)
        assert view.alpha.mean() > 0.9
        assert 1.5 < np.median(view.depth[view.alpha > 0.5]) < 5


def test_the_photo_is_not_the_render(renderer):
    """Exposure, lens, blur and noise set it apart; undoing none of them must leave it far from a plain render."""
    camera = sample_cameras()[0]
    photo = make_photo(renderer, camera)
    render = np.clip(renderer.render(camera.intrinsics.pinhole(), camera.pose).color * 255, 0, 255)
    assert np.abs(photo.pixels - render).mean() > 8
    other = make_photo(renderer, camera, seed=1)
    assert not np.array_equal(photo.pixels, other.pixels)


def test_the_start_is_exactly_as_far_off_as_told():
    camera = sample_cameras()[0]
    assert pose_error(perturb_camera(camera, 0.3, 7.0, 4).pose, camera.pose) == pytest.approx((0.3, 7.0), abs=1e-9)


@pytest.mark.parametrize("index", [0, 4])
def test_its_photos_are_refined_to_a_few_millimetres(renderer, index):
    truth = sample_cameras()[index]
    report = refine(renderer, make_photo(renderer, truth, 3), perturb_camera(truth, 0.2, 4.0, index))
    distance, degrees = pose_error(report.camera.pose, truth.pose)
    assert report.verdict == "trusted", report.reasons
    assert distance < 0.005 and degrees < 0.1


def test_the_chessboard_is_smooth_only_for_the_right_camera(renderer):
    truth = sample_cameras()[0]
    photo = make_photo(renderer, truth)
    wrong = perturb_camera(truth, 0.3, 6.0)
    right, off = (np.abs(chessboard(renderer, photo, c).astype(int) - photo.pixels).mean() for c in (truth, wrong))
    assert right < 0.6 * off
    both = before_after(renderer, photo, wrong, truth)
    assert both.shape[1] == 2 * photo.width + 8 and both.dtype == np.uint8


def test_written_files_read_back(tmp_path):
    files = write_sample(tmp_path / "new")
    assert len(read_splats(files.scene)) == pytest.approx(40_000, rel=0.05)
    start, truth = (read_cameras(f)[0] for f in (files.start, files.truth))
    assert start.intrinsics == truth.intrinsics and pose_error(start.pose, truth.pose)[1] == pytest.approx(8.0, abs=1e-6)
    assert replace(start, pose=truth.pose) == truth or start.file == truth.file


def test_the_demo_brings_its_photo_home(tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path)]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    truth = read_cameras(tmp_path / "truth.json")[0]
    centre = -np.array(result["R"]).T @ np.array(result["t"])
    assert result["verdict"] == "trusted"
    assert np.linalg.norm(centre - truth.pose.centre) < 0.005
    assert (tmp_path / "before_after.png").stat().st_size > 50_000
    assert "found without a start" in capsys.readouterr().out
    assert result["hypothesis"]["inliers"] >= 25
    start = read_cameras(tmp_path / "start.json")[0]
    np.testing.assert_raises(AssertionError, np.testing.assert_allclose, result["start"]["t"], start.pose.t, atol=0.1)
