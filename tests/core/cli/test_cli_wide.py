"""Photos of wide lenses through the command line: refined, in a batch, searched for, drawn and exported."""

import json

import cv2
import numpy as np
import pytest
from wide_photos import fisheye_lens, fisheye_rays, panorama_rays, rendered_photo

from core.cameras import starts
from core.cameras.files import camera_from_dict, camera_to_dict
from core.cli.main import main
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.geometry.pinhole_cut import WideCamera
from core.geometry.wide_lens import WideLens
from core.render import Renderer, RenderSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene, perturb_camera, sample_cameras

pytestmark = pytest.mark.loop
DEPTH = 3.2
SIDE = 360
FAST = ["--long-side-px", "200", "--final-long-side-px", "200", "--iterations", "2", "--candidates", "3"]
FASTER = ["--long-side-px", "200", "--final-long-side-px", "200", "--iterations", "1", "--candidates", "2"]


class WidePlace:
    """A room with a fisheye photo and a panorama, and rough cameras for both."""

    def __init__(self, folder):
        self.folder, self.scene = folder, folder / "scene.ply"
        scene = make_scene(0, 12_000)
        write_ply(self.scene, scene)
        renderer = Renderer(scene, RenderSettings(threads=1))
        self.truth = sample_cameras(1)[0].pose
        self.lens, self.panorama = fisheye_lens(SIDE), WideLens.panorama(2 * SIDE, SIDE)
        self.fish = WideCamera.of(self.lens, self.start(0.05, 4.0), "fish.png")
        self.all = WideCamera.of(self.panorama, self.start(0.05, 4.0), "all.png")
        fish = rendered_photo(renderer, fisheye_rays(self.lens), (SIDE, SIDE), self.truth, 400)
        around = rendered_photo(renderer, panorama_rays(2 * SIDE), (SIDE, 2 * SIDE), self.truth, 400)
        cv2.imwrite(str(folder / "fish.png"), fish.pixels[..., ::-1])
        cv2.imwrite(str(folder / "all.png"), around.pixels[..., ::-1])

    def start(self, ratio, degrees):
        return perturb_camera(Camera(Intrinsics(2, 2, 1, 1, 1, 1), self.truth), ratio * DEPTH, degrees, 1).pose

    def cameras(self, *cameras):
        path = self.folder / "cameras.json"
        path.write_text(json.dumps({"frames": [camera_to_dict(camera) for camera in cameras]}))
        return path

    def off(self, record):
        """Per cent of the depth, degrees."""
        distance, degrees = pose_error(Pose(record["R"], record["t"]), self.truth)
        return 100 * distance / DEPTH, degrees


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return WidePlace(tmp_path_factory.mktemp("wide"))


def test_a_fisheye_comes_home_and_keeps_its_lens(place, tmp_path):
    out, file = tmp_path / "out.json", place.cameras(place.fish)
    code = main(["refine", *map(str, (place.scene, place.folder / "fish.png", "--camera", file, "--out", out)), *FAST])
    record = json.loads(out.read_text())
    assert code == 0 and record["verdict"] in ("trusted", "check"), record["reasons"]
    distance, degrees = place.off(record)
    assert distance < 0.2 and degrees < 0.1
    assert record["camera_model"] == "OPENCV_FISHEYE" and record["coefficients"] == place.lens.values
    assert (record["width"], record["fx"]) == (SIDE, place.lens.fx)
    assert record["cut"]["fx"] == pytest.approx(place.lens.fx, rel=1e-6)
    assert "The photo was matched through a pinhole cut of 100 degrees out of its lens OPENCV_FISHEYE." in record["reasons"]
    back = camera_from_dict(record)
    assert isinstance(back, WideCamera) and back.lens == place.lens


def test_a_panorama_comes_home_by_its_faces(place, tmp_path):
    out, file = tmp_path / "out.json", place.cameras(place.all)
    code = main(["refine", *map(str, (place.scene, place.folder / "all.png", "--camera", file, "--out", out)), *FASTER])
    record = json.loads(out.read_text())
    assert code == 0 and record["verdict"] == "trusted", record["reasons"]
    distance, degrees = place.off(record)
    assert distance < 0.2 and degrees < 0.1
    assert (record["camera_model"], record["width"], record["height"]) == ("EQUIRECTANGULAR", 2 * SIDE, SIDE)
    assert "of 6 parts of the panorama (front, " in record["reasons"][0]
    # Behind the camera the room has no wall, which no face may hide.
    assert "left out: " in record["reasons"][0] and "back" in record["reasons"][0].split("left out: ")[1]


def test_a_batch_cuts_as_well(place, tmp_path):
    file, out = place.cameras(place.fish), tmp_path / "out.json"
    code = main(["batch", str(place.scene), str(file), "--out", str(out), "--workers", "1", "--no-locate", *FAST])
    (record,) = json.loads(out.read_text())["frames"]
    assert code == 0 and record["verdict"] in ("trusted", "check")
    assert place.off(record)[0] < 0.2 and record["camera_model"] == "OPENCV_FISHEYE"


def test_a_photo_comes_home_through_its_st_map(place, tmp_path, capsys):
    assert main(["stmap", str(place.cameras(place.fish)), str(tmp_path)]) == 0
    straight = Camera(place.fish.intrinsics, place.fish.pose, "fish.png")
    out, stmap = tmp_path / "out.json", tmp_path / "fish_undistort.exr"
    start = place.cameras(straight)
    argv = [place.scene, place.folder / "fish.png", "--camera", start, "--stmap", stmap, "--out", out]
    code = main(["refine", *map(str, argv), *FAST])
    record = json.loads(out.read_text())
    assert code == 0 and record["verdict"] in ("trusted", "check"), record["reasons"]
    assert place.off(record)[0] < 0.2
    assert (record["width"], record["stmap"]) == (straight.intrinsics.width, str(stmap))
    assert "as the ST map 'fish_undistort.exr' undistorts it" in capsys.readouterr().err
    argv[3] = place.cameras(place.fish)
    assert main(["refine", *map(str, argv), *FAST]) == 2
    assert "is that of the photo, not of the undistorted picture" in capsys.readouterr().err


def test_a_panorama_without_a_start_is_refused(place, tmp_path, capsys):
    file = tmp_path / "lens.json"
    file.write_text(json.dumps({"file": "all.png", "camera_model": "EQUIRECTANGULAR", "width": 2 * SIDE, "height": SIDE}))
    code = main(["locate", str(place.scene), str(place.folder / "all.png"), "--camera", str(file)])
    assert code == 2
    assert "'all.png' is a panorama, which the command 'refine' places from a start with R and t" in capsys.readouterr().err


@pytest.mark.parametrize("layout", ["json", "colmap", "nerfstudio"])
def test_exports_give_the_lens_back(place, tmp_path, layout):
    file, out = place.cameras(place.fish, place.all), tmp_path / "out"
    assert main(["convert", str(file), str(out), "--to", layout]) == 0
    found = starts(out).placed
    assert [start.file for start in found] == ["fish.png", "all.png"]
    for start, given in zip(found, (place.fish, place.all), strict=True):
        assert start.wide == given.lens
        np.testing.assert_allclose(start.pose.R, given.pose.R, atol=1e-12)


def test_a_lens_that_a_layout_has_not_is_named(place, tmp_path, capsys):
    lens = WideLens("BROWN", 640, 480, 300, 300, 320, 240, (("k1", 0.1), ("k4", 0.1)))
    file = place.cameras(WideCamera.of(lens, place.truth, "a.png"))
    assert main(["convert", str(file), str(tmp_path / "m"), "--to", "colmap"]) == 2
    assert "COLMAP has no lens model BROWN with these values; write --to json." in capsys.readouterr().err
    assert main(["convert", str(file), str(tmp_path / "m.json"), "--to", "nerfstudio"]) == 2
    assert "nerfstudio has no lens model BROWN" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"camera_model": "MEI"}, "has the camera_model MEI; use one of"),
        ({"coefficients": {"k9": 1}}, "has no k9; it has k1, k2, k3, k4"),
        ({"coefficients": {"k1": "a"}}, 'has the entry "k1", which is not a number'),
        ({"coefficients": [1]}, "that are no names with numbers"),
        ({"fx": None}, 'has the entry "fx", which is not a number'),
        ({"camera_model": "EQUIRECTANGULAR", "width": 100, "height": 100}, "twice as wide as high"),
    ],
)
def test_a_lens_that_is_none_is_said(place, tmp_path, capsys, more, said):
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({**camera_to_dict(place.fish), **more}))
    assert main(["convert", str(file), str(tmp_path / "m"), "--to", "colmap"]) == 2
    assert said in capsys.readouterr().err
