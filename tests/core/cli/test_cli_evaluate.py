"""`evaluate` as a user meets it, and the published figures it must reproduce."""

import json
from pathlib import Path

import numpy as np
import pytest
from dataset_files import CAMBRIDGE_LINE, CAMBRIDGE_TITLE, CENTRE, LINE, OPENGL, R, cambridge, put, seven_scenes

from core.cameras import colmap, pose_list
from core.cameras.files import write_cameras
from core.cli.main import main
from core.geometry.camera import Camera, Intrinsics, Pose

PUBLISHED = Path(__file__).parents[3].parent / "shared" / "eval"
MOVED = "0.5 0.5 -0.5 0.5 2 3 -0.97"  # along the line of sight by 3 cm


def evaluate(capsys, *argv):
    """(exit code, stdout, stderr)."""
    code = main(["evaluate", *map(str, argv)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def report(capsys, *argv):
    code, out, _ = evaluate(capsys, *argv, "--json")
    assert code == 0
    return json.loads(out)


def test_json_has_the_documented_keys_and_the_files_unit(tmp_path, capsys):
    truth = put(tmp_path / "t.txt", f"seq-03/frame-1.color.png {LINE}\nseq-03/frame-2.color.png {LINE}\n")
    estimate = put(tmp_path / "e.txt", f"seq-03-frame-2 {LINE}\nseq-03-frame-1 {MOVED} 525\n")
    found = report(capsys, "--truth", truth, "--estimate", estimate)
    assert (found.pop("n"), found.pop("missing")) == (2, 0)
    recall = found.pop("recall")
    assert found == {
        "median_translation": pytest.approx(0.015),
        "mean_translation": pytest.approx(0.015),
        "median_rotation_deg": pytest.approx(0, abs=1e-6),
        "mean_rotation_deg": pytest.approx(0, abs=1e-6),
    }
    assert recall["2cm2"] == 50
    assert recall["5cm5"] == 100


def test_missing_queries_are_infinitely_wrong_and_told(tmp_path, capsys):
    truth = put(tmp_path / "t.txt", f"a.png {LINE}\nb.png {LINE}\nc.png {LINE}\n")
    estimate = put(tmp_path / "e.txt", f"a.png {LINE}\nz.png {LINE}\n")
    code, out, err = evaluate(capsys, "--truth", truth, "--estimate", estimate)
    assert code == 0
    assert "| 3 | 2 | inf / inf | inf / inf | 33.3 |" in out
    assert "2 of 3 photos" in err
    assert "has no photo for 1 of 2 poses in 'e.txt', which does not count." in err
    found = report(capsys, "--truth", truth, "--estimate", estimate)
    assert found["median_translation"] is None
    assert found["recall"]["5m10"] == pytest.approx(100 / 3)


def test_starts_stand_beside_what_was_made_of_them(tmp_path, capsys):
    truth, start = put(tmp_path / "t.txt", f"a.png {LINE}\n"), put(tmp_path / "s.txt", f"a.png {MOVED}\n")
    code, out, _ = evaluate(capsys, "--truth", truth, "--estimate", truth, "--start", start)
    assert code == 0
    first, second = out.splitlines()[2:]
    assert "start | 1 | 0 | 3.00 / 0.00" in first
    assert "| 1 | 0 | 0.00 / 0.00" in second
    found = report(capsys, "--truth", truth, "--estimate", truth, "--start", start)
    assert found["median_translation"] == pytest.approx(0, abs=1e-12)
    assert found["start"]["median_translation"] == pytest.approx(0.03)


def test_every_layout_against_every_other(tmp_path, capsys):
    """One camera in all layouts: all errors are zero."""
    camera = Camera(Intrinsics(8, 6, 5, 5, 4, 3), Pose.from_centre(R, CENTRE), "seq-02/frame-000000.color.png")
    name = camera.file
    scenes = seven_scenes(tmp_path / "chess", frames=1)
    for file in scenes.glob("*/*.pose.txt"):
        put(file, "0 0 1 1\n-1 0 0 2\n0 -1 0 3\n0 0 0 1\n")
    put(scenes / "TestSplit.txt", "sequence2\n")
    write_cameras(tmp_path / "c.json", [camera])
    colmap.write_model(tmp_path / "colmap", [camera])
    pose_list.write(tmp_path / "p.txt", [(name, camera.pose)])
    frame = {"file_path": "images/seq-02/frame-000000.color.png", "transform_matrix": OPENGL}
    files = [
        scenes,
        tmp_path / "c.json",
        tmp_path / "colmap",
        tmp_path / "colmap" / "images.txt",
        tmp_path / "p.txt",
        put(tmp_path / "cam.txt", CAMBRIDGE_TITLE + f"{name} {CAMBRIDGE_LINE}\n"),
        put(tmp_path / "transforms.json", json.dumps({"frames": [frame]})),
    ]
    for truth in files:
        for estimate in files:
            found = report(capsys, "--truth", truth, "--estimate", estimate)
            assert (found["n"], found["missing"]) == (1, 0)
            assert found["mean_translation"] < 1e-12
            assert found["mean_rotation_deg"] < 1e-9


def test_the_unit_is_the_layouts_or_the_users(tmp_path, capsys):
    write_cameras(tmp_path / "c.json", [Camera(Intrinsics(8, 6, 5, 5, 4, 3), Pose(), "a.png")])
    same = ["--truth", tmp_path / "c.json", "--estimate", tmp_path / "c.json"]
    assert "median units / deg" in evaluate(capsys, *same)[1]
    assert "median cm / deg" in evaluate(capsys, *same, "--unit", "m")[1]
    truth = put(tmp_path / "t.txt", f"a.png {LINE}\n")
    assert "median units / deg" in evaluate(capsys, "--truth", truth, "--estimate", truth, "--unit", "scene")[1]


# ---- several scenes


def scenes(tmp_path):
    """Two scene folders, and estimates that are exact for the first and 3 cm off for the second."""
    cambridge(tmp_path / "truth" / "Shop")
    cambridge(tmp_path / "truth" / "King")
    names = ("seq2/frame00001.png", "seq2/frame00002.png")
    lines = {"Shop": [f"{n} {LINE}\n" for n in names], "King": [f"{n} {MOVED}\n" for n in names]}
    for scene, each in lines.items():
        put(tmp_path / "apart" / f"{scene}.txt", "".join(each))
        put(tmp_path / "pattern" / scene / "found.txt", "".join(each))
    together = put(tmp_path / "together.txt", "".join(f"{s}/{line}" for s, each in lines.items() for line in each))
    return tmp_path / "truth", [together, tmp_path / "apart", tmp_path / "pattern", tmp_path / "pattern/{scene}/found.txt"]


def test_a_folder_of_scenes(tmp_path, capsys):
    truth, estimates = scenes(tmp_path)
    for estimate in estimates:
        found = report(capsys, "--truth", truth, "--estimate", estimate)
        assert list(found["scenes"]) == ["King", "Shop"]
        assert found["scenes"]["King"]["median_translation"] == pytest.approx(0.03)
        assert found["scenes"]["Shop"]["median_translation"] == pytest.approx(0, abs=1e-12)
        assert (found["n"], found["median_translation"], found["recall"]["2cm2"]) == (4, pytest.approx(0.015), 50)
        out = evaluate(capsys, "--truth", truth, "--estimate", estimate)[1]
        assert [line.split(" | ")[0] for line in out.splitlines()[2:]] == ["| King", "| Shop", "| average"]
    pattern = str(truth / "{scene}" / "dataset_test.txt")
    assert report(capsys, "--truth", pattern, "--estimate", estimates[0])["n"] == 4


def mistakes(tmp):
    truth, (together, apart, *_) = scenes(tmp)
    one = put(tmp / "one.txt", f"a.png {LINE}\n")
    ambiguous = put(tmp / "twice.txt", f"b/a.png {LINE}\nc/a.png {LINE}\n")
    (apart / "King.txt").unlink()
    put(tmp / "many/King/a.txt", "")
    put(tmp / "many/King/b.txt", "")
    return {
        "no truth": (["--estimate", one], "required: --truth"),
        "nothing there": (["--truth", tmp / "no.txt", "--estimate", one], "There is nothing at"),
        "no estimate there": (["--truth", one, "--estimate", tmp / "no.txt"], "There is nothing at"),
        "empty folder": (["--truth", tmp / "apart", "--estimate", one], "is no folder of poses"),
        "no such pattern": (["--truth", tmp / "no/{scene}.txt", "--estimate", one], "No file is of the form"),
        "another scene": (["--truth", one, "--estimate", together], "No name of 'together.txt'"),
        "ambiguous": (["--truth", one, "--estimate", ambiguous], "could be 'b/a.png' or 'c/a.png'"),
        "scene missing": (["--truth", truth, "--estimate", apart], "no poses of the scene 'King'"),
        "no scene in names": (["--truth", truth, "--estimate", one], "begins with 'King/'"),
        "which file": (["--truth", tmp / "many", "--estimate", one], "say which, as in .../{scene}/a.txt"),
        "style": (["--truth", one, "--estimate", one, "--style", "other"], "invalid choice"),
    }


def test_every_mistake_gets_exit_2_and_one_sentence(tmp_path, capsys):
    for argv, words in mistakes(tmp_path).values():
        code, out, err = evaluate(capsys, *argv)
        assert (code, out) == (2, ""), argv
        assert words in err
        assert err.count("\n") == 1
        assert "Traceback" not in err


def test_a_caller_hears_of_no_scene(tmp_path, capsys):
    """Blender's --blend has nothing to save here."""
    truth, heard = str(put(tmp_path / "t.txt", f"a.png {LINE}\n")), []
    assert main(["evaluate", "--truth", truth, "--estimate", truth], on_outcome=lambda *a: heard.append(a)) == 0
    assert not heard


# ---- ring 3: the published pose files


FIGURES = {
    ("chess", "dfnet"): ("3.30 / 1.12", "20.3", "73.3"),
    ("chess", "hloc"): ("0.78 / 0.11", "99.6", "100.0"),
    ("chess", "as"): ("0.43 / 0.14", "99.1", "99.9"),
    ("stairs", "dfnet"): ("11.97 / 2.63", "0.5", "9.1"),
    ("stairs", "hloc"): ("2.89 / 0.80", "33.0", "72.0"),
    ("stairs", "as"): ("1.43 / 0.44", "66.9", "91.9"),
}


@pytest.mark.scan
@pytest.mark.skipif(not PUBLISHED.exists(), reason="the published pose files (shared/eval) are not here")
@pytest.mark.parametrize(("scene", "method"), FIGURES)
def test_published_figures_to_the_printed_digit(scene, method, capsys):
    folder = PUBLISHED / scene
    code, out, err = evaluate(capsys, "--truth", folder / "truth_sfm.txt", "--estimate", folder / f"{method}.txt")
    assert (code, err) == (0, "")
    head, _, row = ([cell.strip() for cell in line.strip("|").split("|")] for line in out.splitlines())
    cells = dict(zip(head, row, strict=True))
    assert (cells["median cm / deg"], cells["2cm2"], cells["5cm5"]) == FIGURES[scene, method]
    assert (cells["n"], cells["missing"]) == ("2000" if scene == "chess" else "1000", "0")


@pytest.mark.scan
@pytest.mark.skipif(not PUBLISHED.exists(), reason="the published pose files (shared/eval) are not here")
def test_published_files_are_spelled_as_they_are(tmp_path, capsys):
    """The same poses under the other spelling, without extensions and with dashes, give the same figures."""
    respelled = [line.split() for line in (PUBLISHED / "stairs/hloc.txt").read_text().splitlines()]
    lines = [" ".join([name.replace("/", "-").removesuffix(".color.png"), *rest]) for name, *rest in respelled]
    estimate = put(tmp_path / "e.txt", "\n".join(np.random.default_rng(0).permutation(lines)))
    truth = PUBLISHED / "stairs/truth_sfm.txt"
    assert report(capsys, "--truth", truth, "--estimate", estimate) == report(
        capsys, "--truth", truth, "--estimate", PUBLISHED / "stairs/hloc.txt"
    )
