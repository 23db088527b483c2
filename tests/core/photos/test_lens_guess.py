"""Starts without a lens: what the photo gives them, and what is said of it."""

import json

import numpy as np
import pytest
from cli_place import FAST, Place
from photo_files import SHORT, encoded, exif, picture, tiff

from core.cameras.files import camera_from_dict, camera_to_dict, read_cameras, read_starts
from core.cli.main import main
from core.errors import CameraError, PhotoError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.lens_guess import DEFAULT_FOV_DEG, guess_lens, guess_lens_of_file
from core.photos.photo import read_photo

POSE = {"R": np.eye(3).tolist(), "t": [0, 0, 1]}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"), photos=2)


def put(path, data):
    path.write_text(json.dumps(data))
    return path


def test_a_pose_alone_is_a_start_and_no_camera(tmp_path):
    file = put(tmp_path / "s.json", {"frames": [POSE, POSE | {"file": "b.jpg"}]})
    starts = read_starts(file)
    assert [(s.intrinsics, s.focal_guessed, s.file) for s in starts] == [(None, True, ""), (None, True, "b.jpg")]
    with pytest.raises(CameraError, match="lacks width, height, fx, fy, cx, cy;"):
        read_cameras(file)
    guess = Intrinsics(60, 40, 50, 50, 30, 20)
    assert starts[1].camera(guess).focal_guessed
    assert starts[1].camera(guess).intrinsics == guess


@pytest.mark.parametrize("part", [{"fx": 50}, {"width": 60, "height": 40}, {"dist": [0.1, 0, 0, 0]}])
def test_half_a_lens_is_refused(tmp_path, part):
    with pytest.raises(CameraError, match="lacks "):
        read_starts(put(tmp_path / "s.json", POSE | part))


def test_focal_guessed_goes_round_and_stands_only_where_true():
    lens = Intrinsics(60, 40, 50, 50, 30, 20)
    for guessed in (True, False):
        data = camera_to_dict(Camera(lens, Pose(), "a.jpg", guessed))
        assert ("focal_guessed" in data) == guessed
        assert camera_from_dict(data).focal_guessed == guessed
    with pytest.raises(CameraError, match="neither true nor false"):
        camera_from_dict(data | {"focal_guessed": 1})


def test_exif_gives_the_focal_length_over_the_diagonal(tmp_path):
    block = exif(sub={0xA405: (SHORT, 28)})
    (tmp_path / "a.jpg").write_bytes(encoded(".jpg", picture(48, 64), block))
    guess = guess_lens(read_photo(tmp_path / "a.jpg"))
    assert guess.intrinsics.fx == pytest.approx(28 * 80 / np.hypot(36, 24))
    assert (guess.intrinsics.cx, guess.intrinsics.cy, guess.focal_35mm) == (32, 24, 28)
    assert guess == guess_lens_of_file(tmp_path / "a.jpg")


@pytest.mark.parametrize("size", [(48, 64), (64, 48)])
def test_without_exif_the_long_side_sees_the_default_angle(tmp_path, size):
    (tmp_path / "a.png").write_bytes(encoded(".png", picture(*size)))
    lens = guess_lens_of_file(tmp_path / "a.png").intrinsics
    assert (lens.height, lens.width) == size
    assert np.degrees(2 * np.arctan(32 / lens.fx)) == pytest.approx(DEFAULT_FOV_DEG)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tif"])
def test_the_header_tells_what_the_whole_photo_does(tmp_path, suffix, orientation):
    block = exif({0x0112: (SHORT, orientation)}, {0xA405: (SHORT, 35)})
    image = picture(48, 64)
    data = tiff(image, orientation) if suffix == ".tif" else encoded(suffix, image, block)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data)
    assert guess_lens_of_file(path) == guess_lens(read_photo(path))


def test_what_is_no_photo_is_refused(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"no picture")
    with pytest.raises(PhotoError):
        guess_lens_of_file(tmp_path / "a.jpg")


def test_refine_says_what_it_assumed(place, tmp_path, capsys):
    start = {key: value for key, value in camera_to_dict(place.starts[0]).items() if key in ("R", "t")}
    file, out = put(tmp_path / "start.json", start), tmp_path / "result.json"
    arguments = ["refine", place.scene, place.folder / "photo_0.png", "--camera", file, "--out", out, *FAST]
    code = main([str(a) for a in arguments])
    said = capsys.readouterr().err
    assert said.count("The start tells no lens: 55 degrees across the long side are assumed") == 1
    result = json.loads(out.read_text())
    assert code in (0, 3)
    assert result["lens"]["focal"]["state"] == "solved"  # nobody told it
    assert result.get("focal_guessed", False) == (result["verdict"] == "failed")


def test_batch_says_how_many_it_assumed(place, tmp_path, capsys):
    frames = [{"file": str(place.folder / f"photo_{i}.png"), **POSE} for i in range(2)] + [{"file": "none.jpg", **POSE}]
    file, out = put(tmp_path / "q.json", {"frames": frames}), tmp_path / "results.json"
    arguments = ["batch", place.scene, file, "--out", out, "--workers", "1", *FAST, "--iterations", "1", "--no-locate"]
    assert main([str(a) for a in arguments]) == 3
    assert "No lens is given for 2 of 3 photos: it is EXIF's for 0, and 55 degrees across the long side for 2." in (
        capsys.readouterr().err
    )
    records = json.loads(out.read_text())["frames"]
    assert [r.get("focal_guessed") for r in records] == [True, True, None]
    assert "width" not in records[2]  # nothing is known of its lens
    assert "There is no photo" in records[2]["error"]


def test_poses_without_lenses_can_be_evaluated(place, tmp_path, capsys):
    frames = [{"file": c.file, "R": c.pose.R.tolist(), "t": c.pose.t.tolist()} for c in place.truths]
    file = str(put(tmp_path / "truth.json", {"frames": frames}))
    assert main(["evaluate", "--truth", file, "--estimate", file]) == 0
