"""`track`: a plate's frames in a camera file that other commands read, its start found or given, and what it refuses."""

import json

import cv2
import pytest

from core.cameras import camera_file
from core.cameras.files import camera_to_dict
from core.cli.main import main
from core.cli.shots import PlateFrames
from core.geometry.camera import pose_error
from core.render import Renderer, RenderSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene
from core.synthetic.plate import HandHeld
from core.synthetic.sample import DEPTH, LENS, perturb_camera

SHOT = HandHeld(count=5, lens=LENS.resized(320, 240))
FAST = ["--track-long-side", "320", "--long-side", "320", "--no-locate"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    scene = make_scene(0, 24_000)
    write_ply(folder / "room.ply", scene)
    renderer = Renderer(scene, RenderSettings())
    for frame in SHOT.frames:
        cv2.imwrite(str(folder / f"plate.{frame:04d}.png"), SHOT.photo(renderer, frame).pixels[:, :, ::-1])
    start = perturb_camera(SHOT.camera(1003), 0.05 * DEPTH, 3.0)
    (folder / "start.json").write_text(json.dumps(camera_to_dict(start)))
    return folder


def track(place, out, *more):
    return main(["track", str(place / "room.ply"), str(place / "plate.1001.png"), "--out", str(out), *FAST, *more])


def start(place, frame=1003):
    return "--start", f"{frame}={place / 'start.json'}"


def test_the_track_is_a_camera_file_of_every_frame(place, tmp_path, capsys):
    out = tmp_path / "deep" / "t.json"
    assert track(place, out, *start(place)) == 0
    said = capsys.readouterr()
    assert said.out.startswith("trusted after ")
    assert "The start, frame 1003, by itself: trusted" in said.err
    data = json.loads(out.read_text())
    assert [frame["frame"] for frame in data["frames"]] == list(SHOT.frames)
    assert {frame["verdict"] for frame in data["frames"]} == {"trusted"}
    found = camera_file(out).records
    for frame, record in zip(SHOT.frames, found, strict=True):
        distance, degrees = pose_error(record.pose, SHOT.pose(frame))
        assert distance < 0.002 * DEPTH and degrees < 0.05
        assert record.file.endswith(f"plate.{frame}.png")
    assert sorted(p.name for p in out.parent.iterdir()) == ["t.json"], "no journal is left"
    assert main(["convert", str(out), str(tmp_path / "transforms.json")]) == 0


def test_ctrl_c_keeps_what_was_found_and_the_same_command_goes_on(place, tmp_path, capsys, monkeypatch):
    out, journal = tmp_path / "t.json", tmp_path / "t.json.journal"

    read, asked = PlateFrames.read, []

    def interrupt(self, frame):
        asked.append(frame)
        if frame == 1002:
            raise KeyboardInterrupt
        return read(self, frame)

    with monkeypatch.context() as patch:
        patch.setattr(PlateFrames, "read", interrupt)
        assert track(place, out, *start(place)) == 130
    assert "Interrupted; 3 frames found" in capsys.readouterr().err and not out.exists()
    assert track(place, out, *start(place)) == 0
    assert "3 of 5 frames were found before and are kept." in capsys.readouterr().err
    assert not journal.exists() and len(json.loads(out.read_text())["frames"]) == 5


def test_what_is_read_is_not_written_over_and_a_doubted_start_makes_no_trusted_frame(place, tmp_path, capsys):
    frame = place / "plate.1002.png"
    before = frame.read_bytes(), (place / "start.json").read_bytes()
    for out in (frame, place / "start.json"):
        assert track(place, out, *start(place)) == 2
        assert "overwrite" in capsys.readouterr().err
    (tmp_path / "t.json.journal").write_text("diary")
    assert track(place, tmp_path / "t.json", *start(place)) == 2
    assert "is no journal of a track" in capsys.readouterr().err
    assert (tmp_path / "t.json.journal").read_text() == "diary"
    assert (frame.read_bytes(), (place / "start.json").read_bytes()) == before
    assert track(place, tmp_path / "u.json", *start(place), "--mask", str(tmp_path)) == 2
    assert "no mask for any frame" in capsys.readouterr().err
    # A lens that is called calibrated and is 6 % off.
    data = json.loads((place / "start.json").read_text())
    data["fx"], data["fy"], data["focal_guessed"] = 1.06 * data["fx"], 1.06 * data["fy"], False
    (tmp_path / "wrong.json").write_text(json.dumps(data))
    code = track(place, tmp_path / "w.json", "--start", f"1003={tmp_path / 'wrong.json'}", "--frames", "1002-1003")
    if code == 0:
        result = json.loads((tmp_path / "w.json").read_text())
        assert result["verdict"] == "check" and "is to be checked" in result["reasons"][0]
        assert "trusted" not in {frame["verdict"] for frame in result["frames"]}


REFUSED = {
    ("--frames", "1005-1001"): "ends before it begins",
    ("--frames", "7"): "the plate has the frames 1001 to 1005",
    ("--frames", "a-b"): "give the first and the last frame, such as 1001-1005",
    ("--start", "1003"): "give a frame and a camera file, such as 1001=CAMERA.json",
    ("--start", "9=x.json"): "frame 9, which is not among 1001 to 1005",
    (): "There is no start to track from",
}


@pytest.mark.parametrize("flags", REFUSED, ids=str)
def test_what_makes_no_shot_is_one_sentence(place, tmp_path, capsys, flags):
    assert track(place, tmp_path / "t.json", *flags) == 2
    assert REFUSED[flags] in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_frames_behind_a_gap_are_named_and_frames_of_another_size_lost(place, tmp_path, capsys):
    for frame in (1001, 1002, 1003, 1005):
        pixels = cv2.imread(str(place / f"plate.{frame}.png"))
        if frame == 1002:
            pixels = cv2.resize(pixels, (300, 250))
        cv2.imwrite(str(tmp_path / f"p.{frame}.png"), pixels)
    argv = ["track", str(place / "room.ply"), str(tmp_path / "p.1001.png"), "--out", str(tmp_path / "t.json"), *FAST]
    assert main([*argv, *start(place)]) == 0
    said = capsys.readouterr().err
    assert "1 file of the sequence, from 1005 to 1005, lies behind a gap and is left out" in said
    assert "Frame 1002 is lost: " in said and "300 x 250 pixels" in said


def test_a_picture_without_a_number_is_no_plate(place, tmp_path, capsys):
    (tmp_path / "one.png").write_bytes((place / "plate.1001.png").read_bytes())
    argv = ["track", str(place / "room.ply"), str(tmp_path / "one.png"), "--out", str(tmp_path / "t.json")]
    assert main(argv) == 2
    assert "neither a movie nor an image with a number" in capsys.readouterr().err
