"""Batches whose photos have no start, or one that leads nowhere: found by one map, each for itself."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from cli_place import FAST, SIZE, Place, hurt_readers

from core import cameras as datasets
from core.batch.records import TO_FIND
from core.cameras.files import camera_from_dict, camera_to_dict
from core.cli import rounds
from core.cli.main import main
from core.geometry.camera import Pose, pose_error

DEPTH = 3.2
VIEWS = ["--views", "3"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The room, its map of the photos' own cameras, a broken photo, and one of another place."""
    made = Place(tmp_path_factory.mktemp("place"))
    made.known = made.json(made.folder / "known.json", made.truths)
    assert main(["map", str(made.scene), "--cameras", made.known, *VIEWS]) == 0
    (made.folder / "broken.jpg").write_text("no photo")
    (made.folder / "again.png").write_bytes((made.folder / "photo_1.png").read_bytes())
    rng, pixels = np.random.default_rng(0), np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)
    for _ in range(200):
        y, x, h, w = rng.integers(2, (SIZE[1] - 20, SIZE[0] - 20, 30, 30))
        pixels[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    cv2.imwrite(str(made.folder / "other.png"), pixels)
    return made


def lost(camera):
    """A start that nothing can be found from: far outside of the room, looking away."""
    return replace(camera, pose=Pose.from_centre(np.diag([-1.0, 1.0, -1.0]), [40.0, 0.0, -60.0]))


def lens_only(camera):
    return {**camera_to_dict(camera), "R": None, "t": None}


def put(place, name, records):
    path = place.folder / name
    path.write_text(json.dumps({"frames": records}))
    return path


def batch(place, file, out, *more):
    return main(["batch", *map(str, (place.scene, file)), "--out", str(out), "--workers", "2", *FAST, *map(str, more)])


def frames(out):
    return json.loads(out.read_text())["frames"]


def near(record, truth, ratio=0.05):
    distance, degrees = pose_error(camera_from_dict(record).pose, truth.pose)
    return distance < ratio * DEPTH and degrees < 3


def test_every_kind_of_record_gets_its_answer_and_one_bad_one_ends_nothing(place, tmp_path, capsys, monkeypatch):
    records = [
        "broken.jpg",
        camera_to_dict(place.starts[0]),
        lens_only(place.truths[1]),
        camera_to_dict(lost(place.starts[2])),
        "again.png",
        lens_only(replace(place.truths[0], file="other.png")),
        "missing.png",
    ]
    file, out, poses = put(place, "mixed.json", records), tmp_path / "r.json", tmp_path / "poses.txt"
    assert batch(place, file, out, *VIEWS, "--poses", poses) == 3
    found = frames(out)
    assert [f["file"] for f in found] == [r if isinstance(r, str) else r["file"] for r in records]
    assert [f["verdict"] == "failed" for f in found] == [True, False, False, False, False, True, True]
    for k in (0, 5, 6):
        assert (found[k]["R"], found[k]["t"]) == (None, None)
    assert "cannot be decoded" in found[0]["error"]
    assert "There is no photo at" in found[6]["error"]
    assert "No place in the scan matches" in found[5]["reasons"][0]
    assert "error" not in found[5]  # it was tried, and need not be again
    assert "hypothesis" not in found[1]
    for k, truth, ratio in ((2, 1, 0.05), (3, 2, 0.05), (4, 1, 0.12)):
        assert near(found[k], place.truths[truth], ratio)
        assert found[k]["hypothesis"]["inliers"] >= 25
    assert "searched for without it" in found[3]["reasons"][-1]
    assert not [f for f in found if TO_FIND in f]
    for k in (0, 6):
        assert not {"width", "height", "fx", "fy"} & set(found[k])  # nobody knows the lens of a photo that cannot be read
    captured = capsys.readouterr()
    assert "1 of 7 photos had no start and was not found, so it has no pose." in captured.err
    assert "1 failed, 2 not usable; results in" in captured.out
    assert "'other.png' failed: No place in the scan matches" in captured.err
    assert "'missing.png' could not be used: There is no photo at" in captured.err
    assert [line.split()[0] for line in poses.read_text().splitlines()] == [found[k]["file"] for k in (1, 2, 3, 4)]

    hurt_readers(tmp_path / "hook", monkeypatch)  # counts the workers of the second run
    assert batch(place, file, out, *VIEWS) == 3
    assert frames(out) == found
    assert "5 of 7 photos were finished before" in capsys.readouterr().err
    assert datasets.read(out).unsolved == 3
    assert [start.file for start in datasets.starts(out).placed] == [found[k]["file"] for k in (1, 2, 3, 4)]


def test_without_the_search_a_photo_needs_a_start_and_keeps_it(place, tmp_path, capsys):
    unplaced = put(place, "names.json", ["photo_0.png"])
    assert batch(place, unplaced, tmp_path / "r.json", "--no-locate") == 2
    error = capsys.readouterr().err
    assert "Camera 1 of 'names.json' has no R and t" in error
    assert error.count("\n") == 1
    bad = [{"R": None, "t": [0, 0, 1]}, {"file": 7}, 7]
    some = put(place, "some.json", [lens_only(place.truths[0]), camera_to_dict(place.starts[1]), *bad])
    assert batch(place, some, tmp_path / "some.json", "--no-locate") == 3
    records, captured = frames(tmp_path / "some.json"), capsys.readouterr()
    assert [record["verdict"] == "failed" for record in records] == [True, False, True, True, True]
    assert records[0]["error"] == "Camera 1 of 'some.json' has no R and t; give a start, or leave out --no-locate."
    assert {name: records[0][name] for name in lens_only(place.truths[0])} == lens_only(place.truths[0])
    assert "4 not usable; results in" in captured.out
    for record in (records[0], *records[2:]):
        assert record["error"] in captured.err
    far = put(place, "far.json", [camera_to_dict(lost(place.starts[0]))])
    assert batch(place, far, tmp_path / "r.json", "--no-locate") == 3
    (kept,) = frames(tmp_path / "r.json")
    np.testing.assert_allclose(kept["t"], lost(place.starts[0]).pose.t)
    assert "hypothesis" not in kept
    assert batch(place, far, tmp_path / "r.json", *VIEWS) == 0  # another question, so that it is answered anew
    assert near(frames(tmp_path / "r.json")[0], place.truths[0])


def test_a_start_without_lens_whose_photo_cannot_be_read_gets_none(place, tmp_path, capsys):
    """Its record holds what was given, and can be given again; of many such photos the terminal names ten."""
    pose = {name: camera_to_dict(place.starts[0])[name] for name in ("R", "t")}
    file = put(place, "gone.json", [{"file": f"gone_{k}\0.jpg" if k == 3 else f"gone_{k}.jpg", **pose} for k in range(13)])
    out, poses = tmp_path / "r.json", tmp_path / "poses.txt"
    assert batch(place, file, out, "--poses", poses) == 3
    records, captured = frames(out), capsys.readouterr()
    assert "13 not usable" in captured.out
    assert captured.err.count("could not be used") == 9
    assert f"... and 3 more in '{out}'." in captured.err
    assert "Camera 4 of 'gone.json' names no photo" in captured.err
    assert not [record for record in records if "width" in record or "fx" in record]
    np.testing.assert_allclose(records[0]["R"], pose["R"])
    assert records[0]["t"] == pose["t"]
    assert poses.read_text() == ""
    assert batch(place, out, tmp_path / "again.json") == 3


def test_a_batch_interrupted_before_the_search_searches_the_next_time(place, tmp_path, capsys, monkeypatch):
    file = put(place, "two.json", [camera_to_dict(lost(place.starts[0])), camera_to_dict(place.starts[1])])
    out = tmp_path / "r.json"

    def interrupt(cache):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(rounds, "whole_map", interrupt)
        assert batch(place, file, out, *VIEWS) == 130
    first = frames(out)
    assert (first[0]["verdict"], first[0][TO_FIND]) == ("failed", True)
    assert first[1]["verdict"] != "failed"
    capsys.readouterr()
    hurt_readers(tmp_path / "hook", monkeypatch)
    assert batch(place, file, out, *VIEWS) == 0
    assert "1 of 2 photos was finished before" in capsys.readouterr().err
    second = frames(out)
    assert second[1] == first[1]
    assert near(second[0], place.truths[0])
    assert TO_FIND not in second[0]
    assert len(list((tmp_path / "hook").glob("*.pid"))) == 1  # one job, and no refinement from the start again


def test_a_worker_that_dies_in_the_search_costs_one_photo(place, tmp_path, monkeypatch):
    hurt_readers(tmp_path / "hook", monkeypatch)
    (place.folder / "killer.png").write_bytes((place.folder / "photo_1.png").read_bytes())
    file = put(place, "killer.json", ["killer.png", "photo_0.png"])
    assert batch(place, file, tmp_path / "r.json", "--workers", "1", *VIEWS) == 3
    killed, found = frames(tmp_path / "r.json")
    assert "worker process ended on this photo" in killed["error"]
    assert killed["R"] is None
    assert near(found, place.truths[0], 0.12)


def test_a_map_that_cannot_be_stored_serves_the_batch_nevertheless(place, tmp_path, caplog):
    (tmp_path / "file").write_text("")
    file = put(place, "one.json", [lens_only(place.truths[0])])
    more = ["--cameras", place.known, "--map", tmp_path / "file" / "m.gssmc-map"]
    assert batch(place, file, tmp_path / "r.json", *VIEWS, *more) == 0
    assert near(frames(tmp_path / "r.json")[0], place.truths[0])
    assert "cannot be written" in caplog.text
