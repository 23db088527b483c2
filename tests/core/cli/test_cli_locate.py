"""`map`, `locate`, and `refine` without a start, as a user meets them: files in, files out, exit codes, one sentence."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from cli_place import FAST, SIZE, Place

from core.cameras.files import camera_from_dict
from core.cli.main import main
from core.geometry.camera import Pose, pose_error
from core.locate import cache, find
from core.pose.report import RefineProgress, RefineReport
from core.pose.search.loop import TOO_FEW
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene

DEPTH = 3.2
VIEWS = ["--views", "3"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The room, and the map of its three photos' cameras, which needs no search for viewpoints."""
    made = Place(tmp_path_factory.mktemp("place"))
    made.known = made.json(made.folder / "known.json", made.truths)
    assert main(["map", str(made.scene), "--cameras", made.known, *VIEWS]) == 0
    made.map = made.folder / "scene.ply.gssmc-map"
    return made


@pytest.fixture
def builds(monkeypatch):
    """How often a map was begun to be made."""
    begun, build = [], cache.build_map
    monkeypatch.setattr(cache, "build_map", lambda *args: begun.append(args) or build(*args))
    return begun


def run(capsys, *argv):
    """(exit code, stdout, stderr) of one command."""
    code = main([str(a) for a in argv])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def near(record, truth, ratio=0.05):
    distance, degrees = pose_error(camera_from_dict(record).pose, truth.pose)
    return distance < ratio * DEPTH and degrees < 3


def lost(camera):
    """A start that nothing can be found from: far outside of the room, looking away."""
    return replace(camera, pose=Pose.from_centre(np.diag([-1.0, 1.0, -1.0]), [40.0, 0.0, -60.0]))


def other_place(path):
    """A photo with plenty of corners of a place that is not the room."""
    rng, pixels = np.random.default_rng(0), np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)
    for _ in range(200):
        y, x, h, w = rng.integers(2, (SIZE[1] - 20, SIZE[0] - 20, 30, 30))
        pixels[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    cv2.imwrite(str(path), pixels)
    return path


def test_locate_writes_refines_result_with_the_hypothesis_beside_it(place, tmp_path, capsys, builds):
    lens = place.json(tmp_path / "lens.json", place.truths[1:2], R=None, t=None)
    out = tmp_path / "deep" / "r.json"
    argv = [place.scene, place.folder / "photo_1.png", "--camera", lens, "--out", out, *VIEWS, *FAST]
    code, said, err = run(capsys, "locate", *argv)
    result = json.loads(out.read_text())
    assert (code, builds) == (0, []), err
    assert result["verdict"] in ("trusted", "check")
    assert said.startswith(result["verdict"])
    assert near(result, place.truths[1])
    assert camera_from_dict(result).intrinsics == place.truths[1].intrinsics
    assert {"iterations", "reasons", "details", "quality", "start", "stage", "seconds"} <= set(result)
    hypothesis = result["hypothesis"]
    assert hypothesis["focal_factor"] == 1.0
    assert hypothesis["inliers"] >= 25
    np.testing.assert_allclose(hypothesis["t"], result["start"]["t"])
    assert 1 <= result["map_views"] <= 3


def test_locate_guesses_the_lens_and_says_so(place, capsys):
    code, out, err = run(capsys, "locate", place.scene, place.folder / "photo_0.png", *VIEWS, *FAST)
    result = json.loads(out)  # alone on stdout
    assert code == 0
    assert "55 degrees across the long side are assumed" in err
    assert near(result, place.truths[0], 0.12)
    assert result["hypothesis"]["focal_factor"] != 1.0


def test_a_photo_of_another_place_is_not_found_and_gets_no_pose(place, tmp_path, capsys):
    photo, out = other_place(tmp_path / "other.png"), tmp_path / "r.json"
    code, _, _ = run(capsys, "locate", place.scene, photo, "--out", out, *VIEWS, *FAST)
    result = json.loads(out.read_text())
    assert code == 3
    assert (result["verdict"], result["R"], result["t"], result["hypothesis"]) == ("failed", None, None, None)
    assert (result["width"], result["height"], result["map_views"]) == (*SIZE, 3)
    assert result["reasons"][0].startswith("No place in the scan matches the photo")
    code, again, _ = run(capsys, "refine", place.scene, photo, "--camera", out, *VIEWS, *FAST)  # its result as a start
    assert code == 3
    assert json.loads(again)["reasons"] == result["reasons"]


def test_a_place_that_is_refined_in_vain_leaves_no_start_and_no_advice_about_one(place, capsys, monkeypatch):
    def in_vain(renderer, photo, start, settings):
        yield RefineProgress(1, 1, "matching", 0.5)
        return RefineReport(start, start, "failed", (TOO_FEW,), (), 0.1)

    monkeypatch.setattr(find, "iterate_refinement", in_vain)
    code, out, _ = run(capsys, "locate", place.scene, place.folder / "photo_1.png", *VIEWS, *FAST)
    result = json.loads(out)
    assert (code, result["verdict"], result["R"], result["start"]) == (3, "failed", None, None)
    assert result["hypothesis"]["inliers"] > 0
    assert result["reasons"] == [
        "Too few matches between the photo and the splat: the photo may show another place; try more views of the scan, known "
        "cameras, or another photo."
    ]


@pytest.mark.parametrize("camera", [None, '{"frames": ["photo_2.png"]}', '{"file": "a/photo_2.png", "R": null, "t": null}'])
def test_refine_without_a_pose_finds_the_photo(place, tmp_path, capsys, camera):
    argv = [place.scene, place.folder / "photo_2.png", *VIEWS, *FAST]
    if camera:
        (tmp_path / "c.json").write_text(camera)
        argv += ["--camera", tmp_path / "c.json"]
    code, out, _ = run(capsys, "refine", *argv)
    assert code == 0
    assert near(json.loads(out), place.truths[2], 0.12)


def test_refine_searches_where_the_start_leads_nowhere_unless_told_not_to(place, tmp_path, capsys):
    cam = place.json(tmp_path / "c.json", [lost(place.starts[0])])
    argv = ["refine", place.scene, place.folder / "photo_0.png", "--camera", cam, *FAST]
    code, out, err = run(capsys, *argv, *VIEWS)
    found = json.loads(out)
    assert code == 0
    assert near(found, place.truths[0])
    assert "searched for without it" in found["reasons"][-1]
    assert "searched for without it" in err
    code, out, _ = run(capsys, *argv, "--no-locate")
    kept = json.loads(out)
    assert (code, kept["verdict"]) == (3, "failed")
    np.testing.assert_allclose(kept["t"], lost(place.starts[0]).pose.t)
    assert "hypothesis" not in kept


def test_a_start_that_fails_is_kept_where_the_search_fails_too(place, tmp_path, capsys):
    photo = other_place(tmp_path / "other.png")
    cam = place.json(tmp_path / "c.json", [place.starts[0]])
    code, out, _ = run(capsys, "refine", place.scene, photo, "--camera", cam, *VIEWS, *FAST)
    kept = json.loads(out)
    assert (code, kept["verdict"]) == (3, "failed")
    np.testing.assert_allclose(kept["t"], place.starts[0].pose.t)
    assert kept["reasons"][-1].startswith("Without the start: No place in the scan matches")


def test_a_start_that_leads_home_asks_for_no_map(place, tmp_path, capsys, builds):
    shutil.copy(place.scene, tmp_path / "alone.ply")
    cam = place.json(tmp_path / "c.json", place.starts[:1])
    assert run(capsys, "refine", tmp_path / "alone.ply", place.folder / "photo_0.png", "--camera", cam, *FAST)[0] == 0
    assert builds == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["alone.ply", "c.json"]


def test_a_map_that_is_there_is_told_and_not_made_again(place, capsys, builds):
    before = place.map.read_bytes()
    code, out, err = run(capsys, "map", place.scene, *VIEWS)
    assert (code, builds) == (0, [])
    assert out.startswith("3 views, 3 of them from known cameras, ")
    assert str(place.map) in out
    assert "100%" in err
    assert place.map.read_bytes() == before


def test_the_map_is_made_again_when_the_scan_changes(place, tmp_path, capsys, builds, caplog):
    scan = tmp_path / "scan.ply"
    known = ["--cameras", place.known, *VIEWS]
    shutil.copy(place.scene, scan)
    assert run(capsys, "map", scan, *known)[0] == 0
    first = scan.with_name("scan.ply.gssmc-map").read_bytes()
    write_ply(scan, make_scene(5, 12_000))
    assert run(capsys, "map", scan, *known)[0] == 0
    assert len(builds) == 2
    assert "belongs to another scan" in caplog.text
    assert scan.with_name("scan.ply.gssmc-map").read_bytes() != first


def test_a_map_is_kept_where_it_is_told(place, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cache, "user_cache_folder", lambda: tmp_path / "home")
    shutil.copy(place.scene, tmp_path / "s.ply")
    known = ["--cameras", place.known, *VIEWS]
    assert run(capsys, "map", tmp_path / "s.ply", *known, "--map", tmp_path / "in" / "any.name")[0] == 0
    assert run(capsys, "map", tmp_path / "s.ply", *known, "--map-cache", "user")[0] == 0
    assert (tmp_path / "in" / "any.name").read_bytes()[:2] == b"PK"
    assert len(list((tmp_path / "home").glob("*.gssmc-map"))) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["home", "in", "s.ply"]


def test_a_map_that_cannot_be_written_is_one_sentence_before_any_view(place, tmp_path, capsys, builds, monkeypatch):
    (tmp_path / "file").write_text("")
    code, out, err = run(capsys, "map", place.scene, *VIEWS, "--map", tmp_path / "file" / "m.gssmc-map")
    assert (code, out, builds) == (2, "", [])
    assert err.startswith("The map cannot be written to") and err.count("\n") == 1
    assert err.strip().endswith("give another file with --map.")
    monkeypatch.setattr(cache, "user_cache_folder", lambda: tmp_path / "file" / "gssmc")
    assert run(capsys, "map", place.scene, *VIEWS, "--map-cache", "user")[0] == 2
    assert builds == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


def test_a_map_that_cannot_be_kept_in_the_end_is_told_once(place, tmp_path, capsys, monkeypatch, caplog):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache, "write_map", full)
    monkeypatch.setattr(cache, "SAVE_EVERY", 1)
    code, out, err = run(capsys, "map", place.scene, "--cameras", place.known, *VIEWS, "--map", tmp_path / "m.gssmc-map")
    assert (code, out) == (2, "")
    assert caplog.text.count("cannot be written") == 1
    assert err.strip().splitlines()[-1] == "The map was made and could not be kept; make room, or give another file with --map."


def test_ctrl_c_keeps_the_smaller_map_and_says_so(place, tmp_path, capsys, monkeypatch, builds):
    shutil.copy(place.scene, tmp_path / "s.ply")
    argv = ["map", tmp_path / "s.ply", "--cameras", place.known, *VIEWS]

    def interrupted(*args):
        for step in build(*args):
            yield step
            if len(step.map) == 2:
                raise KeyboardInterrupt

    build = cache.build_map
    with monkeypatch.context() as patch:
        patch.setattr(cache, "build_map", interrupted)
        code, out, err = run(capsys, *argv)
    assert (code, out) == (130, "")
    assert "has 2 views and can be used, and continued." in err
    code, found, _ = run(capsys, "locate", tmp_path / "s.ply", place.folder / "photo_0.png", "--views", "2", *FAST)
    assert (code, json.loads(found)["map_views"]) == (0, 2)
    code, out, _ = run(capsys, *argv)
    assert code == 0
    assert out.startswith("3 views")


def test_where_a_new_map_is_kept_is_said_once(place, tmp_path, capsys):
    shutil.copy(place.scene, tmp_path / "s.ply")
    told = f"is kept in '{tmp_path / 's.ply.gssmc-map'}'"
    for expected in (1, 0):
        _, _, err = run(capsys, "locate", tmp_path / "s.ply", place.folder / "photo_0.png", "--views", "1", *FAST)
        assert err.count(told) == expected


def test_ctrl_c_before_the_first_view_leaves_nothing(place, tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt
        yield

    shutil.copy(place.scene, tmp_path / "s.ply")
    monkeypatch.setattr(cache, "build_map", interrupted)
    code, _, err = run(capsys, "map", tmp_path / "s.ply", *VIEWS)
    assert code == 130
    assert "nothing was written" in err
    assert [p.name for p in tmp_path.iterdir()] == ["s.ply"]


def test_known_cameras_of_another_world_are_told(place, tmp_path, capsys):
    far = place.json(tmp_path / "far.json", [place.truths[0], *(lost(c) for c in place.truths[1:])])
    code, _, err = run(capsys, "map", place.scene, "--cameras", far, *VIEWS, "--map", tmp_path / "m.gssmc-map")
    assert code == 0
    assert "2 of 3 known cameras see nothing of the scan" in err


def test_only_trusted_results_count_as_known(place, tmp_path, capsys):
    place.json(tmp_path / "results.json", place.truths)
    data = json.loads((tmp_path / "results.json").read_text())
    data["frames"][0]["verdict"], data["frames"][1]["verdict"] = "trusted", "failed"
    data["frames"] += ["photo_9.png", {"file": "x.png", "R": None, "t": None}]
    (tmp_path / "results.json").write_text(json.dumps(data))
    known = ["--cameras", tmp_path / "results.json", "--views", "2", "--map", tmp_path / "m.gssmc-map"]
    code, out, err = run(capsys, "map", place.scene, *known)
    assert code == 0
    assert "of 2 cameras in" in err
    assert out.startswith("2 views, 2 of them from known cameras")


@pytest.mark.parametrize("command", ["locate", "refine"])
def test_a_result_goes_neither_over_the_scans_map_nor_into_a_folder(place, capsys, command):
    """Both are told before the work: seconds for one photo, hours for a batch."""
    before = place.map.read_bytes()
    for out, said in ((place.map, "would overwrite the scan's map"), (place.folder, "is a folder; give a file")):
        code, _, err = run(capsys, command, place.scene, place.folder / "photo_0.png", "--out", out)
        assert (code, said in err) == (2, True), err
    assert place.map.read_bytes() == before


def test_cameras_beside_the_scan_are_taken_and_said_and_can_be_left_out(place, tmp_path, capsys, monkeypatch):
    scan = tmp_path / "scene.ply"
    shutil.copy(place.scene, scan)
    records = [
        {"img_name": c.file, "position": c.pose.centre.tolist(), "rotation": c.pose.R.T.tolist(), "width": SIZE[0],
         "height": SIZE[1], "fx": c.intrinsics.fx, "fy": c.intrinsics.fy}
        for c in place.truths
    ]  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps(records))
    known = []

    def build(scene, settings, cameras, key, begun):
        known.append([camera.file for camera in cameras])
        yield cache.MapStep(cache.LandmarkMap(key, complete=True), "the map is complete", 1.0)

    monkeypatch.setattr(cache, "build_map", build)
    code, _, err = run(capsys, "map", scan, *VIEWS)
    assert (code, known) == (0, [[c.file for c in place.truths]])
    assert "Known cameras read from" in err
    code, _, err = run(capsys, "map", scan, "--cameras", "none", *VIEWS, "--map", tmp_path / "plain.gssmc-map")
    assert (code, known[1]) == (0, [])
    assert "Known cameras" not in err
