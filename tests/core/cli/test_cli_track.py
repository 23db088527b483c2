"""`track`: a plate's frames in a camera file that other commands read, its start found or given, and what it refuses."""

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.cameras import camera_file
from core.cameras.files import camera_from_dict, camera_to_dict
from core.cli.main import main
from core.cli.plates.given import frames_of
from core.cli.plates.several import finished, out_files
from core.cli.shots import PlateFrames
from core.errors import UsageError
from core.geometry.camera import Pose, pose_error
from core.photos.containers.openexr import write_exr
from core.photos.plate import open_plate
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


@pytest.fixture(scope="module")
def whole(place, tmp_path_factory):
    """A track of all frames, and what was said."""
    out, said, remarks = tmp_path_factory.mktemp("whole") / "deep" / "t.json", io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(remarks):
        assert track(place, out, *start(place)) == 0
    return out, said.getvalue(), remarks.getvalue()


def track(place, out, *more):
    return main(["track", str(place / "room.ply"), str(place / "plate.1001.png"), "--out", str(out), *FAST, *more])


def start(place, frame=1003):
    return "--start", f"{frame}={place / 'start.json'}"


def test_the_track_is_a_camera_file_of_every_frame(whole, tmp_path):
    out, said, remarks = whole
    assert said.startswith("trusted after ")
    assert "The start, frame 1003, by itself: trusted" in remarks
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


def test_a_start_that_fails_and_a_frame_that_is_damaged_end_nothing(place, tmp_path, capsys):
    for frame in SHOT.frames:
        (tmp_path / f"p.{frame}.png").write_bytes((place / f"plate.{frame}.png").read_bytes())
    (tmp_path / "p.1002.png").write_bytes(b"")
    for name, camera in {
        "pin": SHOT.camera(1002),
        "far": replace(SHOT.camera(1004), pose=Pose(np.eye(3), [9e3, 0, 0])),
    }.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(camera_to_dict(camera)))
    argv = ["track", str(place / "room.ply"), str(tmp_path / "p.1001.png"), "--out", str(tmp_path / "t.json"), *FAST]
    argv += ["--pin", f"1002={tmp_path / 'pin.json'}", "--start", f"1004={tmp_path / 'far.json'}"]
    assert main([*argv, *start(place)]) == 0
    assert "A start is left out: Frame 1004 was not placed" in capsys.readouterr().err
    held = camera_file(tmp_path / "t.json").records[1]
    assert pose_error(held.pose, SHOT.pose(1002)) < (1e-9, 1e-6), "the pin holds where the picture cannot be read"
    assert main(argv) == 2
    assert "Frame 1004 was not placed" in capsys.readouterr().err


def test_a_damaged_track_is_refused_and_the_one_that_is_read_is_kept(place, whole, tmp_path, capsys):
    data = json.loads(whole[0].read_text())
    twice = {**data, "frames": [data["frames"][0], *data["frames"]]}
    for damaged, words in (
        ({**data, "readout": float("nan")}, "a number that is none"),
        (twice, "frame 1001 stands there twice"),
    ):
        (tmp_path / "t.json").write_text(json.dumps(damaged))
        assert track(place, tmp_path / "u.json", "--from", str(tmp_path / "t.json"), "--frames", "1002-1003") == 2
        assert f"'t.json' is no track, or a damaged one ({words})" in capsys.readouterr().err
    kept = whole[0].read_bytes()
    assert track(place, whole[0], "--from", str(whole[0]), "--frames", "1002-1003") == 2
    assert "would overwrite the track that it begins with" in capsys.readouterr().err
    assert whole[0].read_bytes() == kept


REFUSED = {
    ("--frames", "1005-1001"): "ends before it begins",
    ("--frames", "7"): "the plate has the frames 1001 to 1005",
    ("--frames", "a-b"): "give the first and the last frame, such as 1001-1005",
    ("--from", "none.json"): "needs the frames to track anew",
    ("--from", "none.json", "--frames", "1002"): "There is no camera file at 'none.json'",
    ("--pin", "9=x.json"): "--pin names frame 9, which is not among 1001 to 1005",
    ("--out-dir", "x"): "Say where to write the cameras",
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


def test_a_pin_is_held_and_a_range_is_tracked_anew_beside_frames_that_stay(place, whole, tmp_path):
    off = perturb_camera(SHOT.camera(1002), 0.002 * DEPTH, 0.1)
    (tmp_path / "pin.json").write_text(json.dumps(camera_to_dict(off)))
    argv = ["--from", str(whole[0]), "--frames", "1002-1003", "--pin", f"1002={tmp_path / 'pin.json'}"]
    assert track(place, tmp_path / "t.json", *argv) == 0
    before, after = (json.loads(path.read_text())["frames"] for path in (whole[0], tmp_path / "t.json"))
    for old, new in zip(before, after, strict=True):
        frame = old["frame"]
        if frame in (1002, 1003):
            assert new["matches"] > 0 and new["R"] != old["R"]
            continue
        assert {**new, "R": 0, "t": 0} == {**old, "R": 0, "t": 0}
        np.testing.assert_allclose(new["t"], old["t"], atol=1e-9)
    found = camera_file(tmp_path / "t.json").records
    assert pose_error(found[1].pose, off.pose) < (1e-9, 1e-6)
    assert pose_error(found[2].pose, SHOT.pose(1003))[0] < 0.002 * DEPTH


def test_several_plates_in_one_call_each_kept_and_none_ends_the_others(place, tmp_path, capsys):
    for folder, numbers in (("a", (1002, 1003)), ("b", (1003, 1004))):
        (tmp_path / folder).mkdir()
        for frame in numbers:
            (tmp_path / folder / f"shot_{folder}.{frame}.exr").write_bytes(b"")
            light = (cv2.imread(str(place / f"plate.{frame}.png"))[:, :, ::-1] / 255.0) ** 2.2
            write_exr(tmp_path / folder / f"shot_{folder}.{frame}.exr", dict(zip("RGB", light.transpose(2, 0, 1), strict=True)))
    (tmp_path / "b" / "shot_b.1003.exr").write_bytes(b"no picture")
    start = perturb_camera(SHOT.camera(1003), 0.05 * DEPTH, 3.0)
    starts = {"frames": [camera_to_dict(replace(start, file=f"{f}/shot_{f}.1003.exr")) for f in "ab"]}
    (tmp_path / "starts.json").write_text(json.dumps(starts))
    plates = [tmp_path / "b" / "shot_b.1004.exr", tmp_path / "a" / "shot_a.1002.exr", tmp_path / "gone.0001.png"]
    argv = ["track", str(place / "room.ply"), *map(str, plates), "--out-dir", str(tmp_path / "out"), *FAST]
    argv += ["--start", str(tmp_path / "starts.json")]
    assert main(argv) == 3
    said = capsys.readouterr()
    lines = [line.split() for line in said.out.splitlines()]
    assert ["shot_b", "not", "tracked:"] in [line[:3] for line in lines]
    assert ["shot_a", "trusted", "2", "0", "0"] in [line[:5] for line in lines]
    assert "gone" in said.out and "1 of 3 plates tracked" in said.out
    data = json.loads((tmp_path / "out" / "shot_a.json").read_text())
    assert data["plate"]["pixel_aspect"] == 1.0 and data["plate"]["fps"] is None
    for record in camera_file(tmp_path / "out" / "shot_a.json").records:
        frame = int(record.file[-8:-4])
        assert pose_error(record.pose, SHOT.pose(frame))[0] < 0.003 * DEPTH
    written = (tmp_path / "out" / "shot_a.json").stat().st_mtime_ns
    assert main(argv) == 3
    assert "(tracked before)" in capsys.readouterr().out
    assert (tmp_path / "out" / "shot_a.json").stat().st_mtime_ns == written


def test_each_plate_has_a_file_of_its_own():
    plates = ["s1/p.1001.exr", "s1/p.1002.exr", "s2/p.1001.exr", "s1/take_2.mov", "s1/take_3.mov", "s1/0001.png"]
    files = out_files([Path(plate) for plate in plates], Path("out"))
    assert {str(plate): file.name for plate, file in files.items()} == {
        "s1/p.1001.exr": "s1_p.json",
        "s2/p.1001.exr": "s2_p.json",
        "s1/take_2.mov": "take_2.json",
        "s1/take_3.mov": "take_3.json",
        "s1/0001.png": "0001.json",
    }


def test_two_plates_for_one_file_are_refused_before_any_work(place, tmp_path, capsys):
    argv = ["track", str(place / "room.ply"), "a/x/p.1.png", "b/x/p.1.png", "--out-dir", str(tmp_path / "out"), *FAST]
    assert main(argv) == 2
    assert "would both be written to" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_range_over_a_gap_names_what_is_missing(tmp_path, capsys):
    for frame in (1001, 1002, 1005, 1006, 1008):
        (tmp_path / f"p.{frame}.png").write_bytes(b"x")
    assert frames_of("1001-1008", *open_plate(tmp_path / "p.1001.png")) == range(1001, 1009)
    assert "Of the plate, 3 frames missing: 1003-1004, 1007." in capsys.readouterr().err
    assert frames_of(None, *open_plate(tmp_path / "p.1005.png")) == range(1005, 1007)
    said = capsys.readouterr().err
    assert "3 files of the sequence, from 1001 to 1008, lie behind a gap" in said
    assert "missing: 1003-1004, 1007; --frames 1001-1008 takes all" in said
    with pytest.raises(UsageError, match="but the plate has the frames 1001 to 1008"):
        frames_of("1001-1009", *open_plate(tmp_path / "p.1005.png"))


def test_a_movie_keeps_its_speed_and_its_frames_are_found(place, tmp_path):
    movie = cv2.VideoWriter(str(tmp_path / "m.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 24000 / 1001, (320, 240))
    for frame in SHOT.frames[1:4]:
        movie.write(cv2.imread(str(place / f"plate.{frame}.png")))
    movie.release()
    argv = ["track", str(place / "room.ply"), str(tmp_path / "m.mp4"), "--out", str(tmp_path / "t.json"), *FAST]
    assert main([*argv, "--start", f"2={place / 'start.json'}", "--zoom"]) == 0
    data = json.loads((tmp_path / "t.json").read_text())
    assert data["plate"]["fps_exact"] == "24000/1001" and data["plate"]["fps"] == 23.976024
    assert "Focal length from" in data["reasons"][-1]
    for frame in data["frames"]:
        assert abs(frame["fx"] / SHOT.lens.fx - 1) < 0.005
        assert pose_error(camera_from_dict(frame).pose, SHOT.pose(1001 + frame["frame"]))[0] < 0.005 * DEPTH


def test_a_frame_that_is_replaced_while_it_is_tracked_ends_the_work_and_has_another_name_for_the_journal(place, tmp_path):
    for frame in SHOT.frames:
        shutil.copy2(place / f"plate.{frame}.png", tmp_path)
    plate, first, last = open_plate(tmp_path / "plate.1001.png")
    photos = PlateFrames(plate, None).seen_now(range(first, last + 1))
    photos.read(1003)
    shutil.copy(place / "plate.1004.png", tmp_path / "plate.1003.png")
    with pytest.raises(OSError, match="was changed while the plate was tracked"):
        photos.read(1003)
    (tmp_path / "plate.1003.png").write_bytes(b"half a fr")
    with pytest.raises(OSError, match="was changed while the plate was tracked"):
        photos.read(1003)
    photos.read(1004)
    assert photos.seen_now(range(first, last + 1)).seen != photos.seen


def test_a_finished_track_with_a_changed_digit_is_made_again(whole, tmp_path):
    data = json.loads(whole[0].read_text())
    file = tmp_path / "t.json"
    file.write_text(json.dumps(data))
    assert finished(file, data["key"]) is not None
    data["frames"][2]["t"][0] += 1e-9
    file.write_text(json.dumps(data))
    assert finished(file, data["key"]) is None
