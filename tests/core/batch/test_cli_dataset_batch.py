"""`batch` on a scene folder: photos and lenses of the data set, starts of a pose file, poses out that `evaluate` reads."""

import json
from dataclasses import replace

import cv2
import pytest
from cli_place import FAST, Place
from dataset_files import CAMBRIDGE_TITLE, LINE, put

from core import cameras as datasets
from core.cameras import pose_list
from core.cli.flags import settings_from
from core.cli.main import build_parser, main
from core.geometry.camera import Intrinsics, Pose, pose_error
from core.geometry.quaternion import quaternion_from_rotation
from core.pose.presets import PRESETS
from core.pose.settings import RefineSettings
from core.render import Renderer, RenderSettings
from core.splats import read_splats
from core.synthetic import make_photo

LENS = Intrinsics(160, 120, 525 / 4, 525 / 4, 80, 60)  # a quarter of 7-Scenes' colour camera


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The sample room, photographed through LENS, as a 7-Scenes folder and as a Cambridge one."""
    made = Place(tmp_path_factory.mktemp("place"))
    renderer = Renderer(read_splats(made.scene), RenderSettings(threads=1))
    made.names = ["seq-02/frame-000000.color.png", "seq-02/frame-000001.color.png", "seq-02/frame-000002.color.png"]
    made.rooms, made.town = made.folder / "room", made.folder / "Town"
    put(made.rooms / "TestSplit.txt", "sequence2\n")
    rows = ""
    for name, camera in zip(made.names, made.truths, strict=True):
        photo = made.rooms / name
        photo.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(photo), make_photo(renderer, replace(camera, intrinsics=LENS), 0).pixels[..., ::-1])
        inverse = camera.pose.inverse()
        matrix = "\n".join(
            " ".join(map(repr, [*map(float, row), float(c)])) for row, c in zip(inverse.R, inverse.t, strict=True)
        )
        put(photo.with_name(photo.name.replace("color.png", "pose.txt")), f"{matrix}\n0 0 0 1\n")
        town = name.replace("seq-02/frame-", "seq2/frame").replace(".color", "")
        put(made.town / town, photo.read_bytes())
        values = [*camera.pose.centre, *quaternion_from_rotation(camera.pose.R)]
        rows += f"{town} {' '.join(repr(float(v)) for v in values)}\n"
    put(made.town / "dataset_test.txt", CAMBRIDGE_TITLE + rows)
    made.start = made.folder / "starts.txt"  # spelled as other projects do
    pose_list.write(made.start, [(n[:-10].replace("/", "-"), c.pose) for n, c in zip(made.names, made.starts, strict=True)])
    return made


def batch(place, *argv):
    return main(["batch", str(place.scene), *map(str, argv), "--workers", "2", *FAST, "--long-side-px", "160"])


def test_7_scenes_folder_to_poses_and_their_evaluation(place, tmp_path, capsys):
    out, poses = tmp_path / "r.json", tmp_path / "poses.txt"
    assert batch(place, place.rooms, "--start", place.start, "--out", out, "--poses", poses) == 0
    records = json.loads(out.read_text())["frames"]
    assert [r["file"] for r in records] == place.names
    assert [(r["width"], r["height"], r["fx"], r["cx"], r["cy"]) for r in records] == [(160, 120, 525 / 4, 80, 60)] * 3
    lines = [line.split() for line in poses.read_text().splitlines()]
    assert [line[0] for line in lines] == place.names
    assert {len(line) for line in lines} == {8}
    capsys.readouterr()
    found = {}
    for estimate in (poses, out):  # the pose list and the results say the same
        argv = ["--truth", place.rooms, "--estimate", estimate, "--start", place.start, "--json"]
        assert main(["evaluate", *map(str, argv)]) == 0
        found[estimate] = json.loads(capsys.readouterr().out)
    assert found[poses]["median_translation"] == pytest.approx(found[out]["median_translation"], abs=1e-9)
    assert (found[poses]["n"], found[poses]["missing"]) == (3, 0)
    before = [pose_error(s.pose, t.pose)[0] for s, t in zip(place.starts, place.truths, strict=True)]
    assert found[poses]["start"]["mean_translation"] == pytest.approx(sum(before) / 3)
    assert found[poses]["median_translation"] < 0.2 * found[poses]["start"]["median_translation"]


def test_a_second_run_keeps_what_was_finished_and_writes_the_poses(place, tmp_path, capsys):
    argv = [place.rooms, "--start", place.start, "--out", tmp_path / "r.json"]
    assert batch(place, *argv) == 0
    before = (tmp_path / "r.json").read_text()
    capsys.readouterr()
    assert batch(place, *argv, "--poses", tmp_path / "p.txt") == 0
    assert "3 of 3 photos were finished before" in capsys.readouterr().err
    assert (tmp_path / "r.json").read_text() == before
    assert datasets.read(tmp_path / "p.txt").names == place.names


def test_cambridge_folder_needs_a_focal_length_and_takes_it(place, tmp_path, capsys):
    starts = tmp_path / "s.txt"
    names = [f"Town/seq2/frame{k:06d}.png" for k in (2, 1)]  # in their own order, the first photo without a start
    pose_list.write(starts, [(n, place.starts[k].pose) for n, k in zip(names, (2, 1), strict=True)])
    argv = [place.town, "--start", starts, "--out", tmp_path / "r.json", "--poses", tmp_path / "p.txt"]
    assert batch(place, *argv) == 2
    assert "give the focal length in pixels with --focal" in capsys.readouterr().err
    assert batch(place, *argv, "--focal", 525 / 4, "--no-locate") == 0
    assert "'s.txt' has no start pose for 1 of 3 test photos; without one, a photo is left out." in capsys.readouterr().err
    found = datasets.read(tmp_path / "p.txt")
    assert found.names == [f"seq2/frame{k:06d}.png" for k in (1, 2)]
    for frame, k in zip(found.frames, (1, 2), strict=True):
        start = pose_error(place.starts[k].pose, place.truths[k].pose)[0]
        assert pose_error(frame.pose, place.truths[k].pose)[0] < 0.3 * start


@pytest.mark.parametrize("layout", ["7scenes", "cambridge"])
def test_a_folder_without_starts_is_found_by_the_scan_alone(place, tmp_path, layout):
    known = place.json(tmp_path / "known.json", place.truths)  # a small map, so that the test is quick
    folder, lens = (place.rooms, []) if layout == "7scenes" else (place.town, ["--focal", 525 / 4])
    argv = [*lens, "--cameras", known, "--views", "3", "--map", tmp_path / "m.gssmc-map", "--out", tmp_path / "r.json"]
    assert batch(place, folder, *argv, "--poses", tmp_path / "p.txt") == 0
    found = datasets.read(tmp_path / "p.txt")
    assert len(found.frames) == 3
    for frame, truth in zip(found.frames, place.truths, strict=True):
        distance, degrees = pose_error(frame.pose, truth.pose)
        assert (distance < 0.1) and (degrees < 1.5)


def test_photos_that_the_start_file_lacks_are_searched_for(place, tmp_path, capsys):
    known, starts = place.json(tmp_path / "known.json", place.truths), tmp_path / "s.txt"
    pose_list.write(starts, [(f"Town/seq2/frame{k:06d}.png", place.starts[k].pose) for k in (2, 1)])
    argv = ["--start", starts, "--focal", 525 / 4, "--cameras", known, "--views", "3", "--map", tmp_path / "m.gssmc-map"]
    assert batch(place, place.town, *argv, "--out", tmp_path / "r.json") == 0
    assert "'s.txt' has no start pose for 1 of 3 test photos; without one, a photo is searched for." in capsys.readouterr().err
    records = json.loads((tmp_path / "r.json").read_text())["frames"]
    assert ["hypothesis" in record for record in records] == [True, False, False]


def test_a_photo_that_cannot_be_read_has_no_pose_and_counts_as_missing(place, tmp_path, capsys):
    name = "seq-02/frame-000003.color.png"
    broken = put(place.rooms / name, "no photo")
    starts = [*((f.name, f.pose) for f in datasets.read(place.start).frames), (name, Pose())]
    pose_list.write(tmp_path / "s.txt", starts)
    try:
        argv = ["--start", tmp_path / "s.txt", "--out", tmp_path / "r.json", "--poses", tmp_path / "p.txt"]
        assert batch(place, place.rooms, *argv) == 3
    finally:
        broken.unlink()
    assert [r["verdict"] == "failed" for r in json.loads((tmp_path / "r.json").read_text())["frames"]] == [False] * 3 + [True]
    assert datasets.read(tmp_path / "p.txt").names == place.names
    truth = put(tmp_path / "t.txt", "".join(f"{n} {LINE}\n" for n in [*place.names, name]))
    capsys.readouterr()
    for estimate in ("p.txt", "r.json"):
        assert main(["evaluate", "--truth", str(truth), "--estimate", str(tmp_path / estimate), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["missing"] == 1


def test_presets_are_the_papers_and_flags_win(capsys):
    def settings(*more):
        args = build_parser().parse_args(["batch", "s.ply", "q", "--out", "r", *more])
        return settings_from(args, PRESETS[args.preset] if args.preset else None)

    assert settings() == RefineSettings()
    room, town = settings("--preset", "7scenes"), settings("--preset", "cambridge")
    assert (room.iterations, room.candidates, room.perturb_translation_units, room.perturb_rotation_deg) == (6, 6, 0.04, 0.01)
    assert (town.iterations, town.candidates, town.perturb_translation_units, town.perturb_rotation_deg) == (4, 6, 4.0, 2.0)
    mixed = settings("--preset", "cambridge", "--iterations", "5", "--no-epipolar")  # 5 is also the default
    assert mixed == replace(town, iterations=5, epipolar=False)
    assert main(["batch", "--help"]) == 0
    assert "{7scenes,cambridge}" in capsys.readouterr().out


def mistakes(place, tmp):
    queries = place.json(tmp / "q.json", [replace(c, file=f"a b{i}.png") for i, c in enumerate(place.starts)])
    other = put(tmp / "other.txt", f"zzz.png {LINE}\n")
    put(tmp / "notes/readme.txt", "hello")
    for name in ("é.PNG", "a.jpg", "readme.txt"):
        put(tmp / "photos" / name, "")
    start = ["--start", place.start]
    return {
        "no starts": ([place.rooms, "--no-locate"], "give them with --start"),
        "starts of another scene": ([place.rooms, "--start", other], "no start pose for any test photo"),
        "starts that are nowhere": ([place.rooms, "--start", tmp / "no.txt"], "There is nothing at"),
        "a folder of photos alone": ([tmp / "photos"], 'in a JSON file there, as in {"frames": ["a.jpg", "é.PNG"]}.'),
        "a folder of something else": ([tmp / "notes", *start], "is no folder of poses"),
        "a model without photos": ([_colmap(tmp), *start], "no folder that photos can be taken from"),
        "focal length of nothing": ([place.rooms, *start, "--focal", "0"], "--focal is 0"),
        "focal length that is none": ([place.rooms, *start, "--focal", "nan"], "--focal: 'nan' is no number"),
        "starts beside a list": ([queries, *start], "--start goes with a data set's folder"),
        "focal length beside a list": ([queries, "--focal", "5"], "--focal goes with a data set's folder"),
        "names with blanks": ([queries, "--poses", tmp / "p.txt"], "'a b0.png' cannot stand in a pose list"),
        "preset": ([place.rooms, *start, "--preset", "moon"], "invalid choice"),
    }


def _colmap(tmp):
    put(tmp / "model/images.txt", f"1 {LINE} 1 a.png\n\n")
    return tmp / "model"


def test_every_mistake_gets_exit_2_and_one_sentence(place, tmp_path, capsys):
    for argv, words in mistakes(place, tmp_path).values():
        assert batch(place, *argv, "--out", tmp_path / "out.json") == 2, argv
        captured = capsys.readouterr()
        assert captured.out == ""
        assert words in captured.err
        assert captured.err.count("\n") == 1
        assert not (tmp_path / "out.json").exists()
