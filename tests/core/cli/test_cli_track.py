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
    assert "Frame 1003: trusted" in said.err
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


REFUSED = {
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


def test_a_picture_without_a_number_is_no_plate(place, tmp_path, capsys):
    (tmp_path / "one.png").write_bytes((place / "plate.1001.png").read_bytes())
    argv = ["track", str(place / "room.ply"), str(tmp_path / "one.png"), "--out", str(tmp_path / "t.json")]
    assert main(argv) == 2
    assert "neither a movie nor an image with a number" in capsys.readouterr().err
