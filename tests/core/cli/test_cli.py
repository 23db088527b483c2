"""The command line as a user meets it: files in, files out, exit codes, and one sentence for every mistake."""

import argparse
import json
import re
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_place import FAST, SIZE, Place

from core.cameras.files import camera_from_dict
from core.cli.commands.render import output_names
from core.cli.flags import settings_from
from core.cli.main import build_parser, main
from core.errors import UsageError
from core.features.registry import EXTRACTORS, MATCHERS
from core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from core.pose.settings import RefineSettings
from core.render import render_reference
from core.splats import read_splats


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"))


def run(capsys, *argv):
    """(exit code, stdout, stderr) of one command."""
    code = main([str(a) for a in argv])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def one_sentence(text):
    """`text` is a single line that ends as a sentence does, and no traceback."""
    assert text.count("\n") == 1
    assert text.strip().endswith((".", "--help'."))
    assert "Traceback" not in text
    return text


# ---- render


def test_render_writes_a_png_per_camera_and_arrays_that_the_slow_twin_agrees_with(place, tmp_path, capsys):
    cameras = [replace(c, intrinsics=c.intrinsics.pinhole().resized(64, 48)) for c in place.truths[:2]]
    file = place.json(tmp_path / "cams.json", cameras)
    code, out, err = run(capsys, "render", place.scene, file, tmp_path / "new" / "out", "--npz", "--threads", "1")
    assert (code, out, err) == (0, "", "")
    assert sorted(p.name for p in (tmp_path / "new" / "out").iterdir()) == [
        "photo_0.npz",
        "photo_0.png",
        "photo_1.npz",
        "photo_1.png",
    ]
    arrays = np.load(tmp_path / "new" / "out" / "photo_1.npz")
    assert {k: (v.shape, v.dtype.name) for k, v in arrays.items()} == {
        "color": ((48, 64, 3), "float32"),
        "depth": ((48, 64), "float32"),
        "alpha": ((48, 64), "float32"),
    }
    twin = render_reference(read_splats(place.scene), cameras[1].intrinsics, cameras[1].pose)
    assert np.abs(arrays["color"] - twin.color).max() < 2 / 255
    png = cv2.imread(str(tmp_path / "new" / "out" / "photo_1.png"))[..., ::-1]
    assert np.abs(png - np.clip(arrays["color"], 0, 1) * 255).max() <= 0.5 + 1e-3


def test_render_repeat_prints_one_json_line(place, tmp_path, capsys):
    file = place.json(tmp_path / "cam.json", [replace(place.truths[0], intrinsics=Intrinsics(32, 24, 25, 25, 16, 12))])
    code, out, _ = run(capsys, "render", place.scene, file, tmp_path / "out", "--repeat", "3")
    assert code == 0
    assert out.count("\n") == 1
    report = json.loads(out)
    assert report["median_ms"] > 0
    assert (report["frames"], report["repeat"], report["gaussians"]) == (1, 3, len(read_splats(place.scene)))


def test_render_names():
    lens, pose = Intrinsics(2, 2, 1, 1, 1, 1), Pose()
    files = ["a/1.jpg", "b/1.jpg", "1.png", "", "", "c\\x.tif"]
    names = output_names([Camera(lens, pose, f) for f in files], "cams")
    assert names == ["1", "1_2", "1_3", "cams", "cams_2", "x"]


# ---- refine


def test_refine_writes_the_documented_result(place, tmp_path, capsys):
    cam = place.json(tmp_path / "cam.json", place.starts[:1])
    out = tmp_path / "deep" / "result.json"
    code, _, err = run(capsys, "refine", place.scene, place.folder / "photo_0.png", "--camera", cam, "--out", out, *FAST)
    result = json.loads(out.read_text())
    assert code == 0, err
    for key in (
        "file",
        "width",
        "height",
        "fx",
        "fy",
        "cx",
        "cy",
        "dist",
        "R",
        "t",
        "verdict",
        "reasons",
        "iterations",
        "seconds",
    ):
        assert key in result
    assert result["verdict"] in ("trusted", "check")
    assert all(reason.endswith(".") for reason in result["reasons"])
    last = result["iterations"][-1]
    assert last["views_used"] >= 2
    assert last["matches"] >= last["inliers"] > 20
    assert 0 < last["rms_px_of_photo"] < 3
    assert np.shape(last["R"]) == (3, 3)
    found = camera_from_dict(result)
    before = pose_error(place.starts[0].pose, place.truths[0].pose)
    after = pose_error(found.pose, place.truths[0].pose)
    assert after[0] < 0.2 * before[0]
    assert after[1] < 0.3 * before[1]
    assert found.intrinsics == place.truths[0].intrinsics


def test_refine_without_out_prints_the_result_alone_on_stdout(place, tmp_path, capsys):
    cameras = place.json(tmp_path / "all.json", place.starts)  # three cameras: the photo's name picks its own
    code, out, _ = run(capsys, "refine", place.scene, place.folder / "photo_1.png", "--camera", cameras, *FAST)
    result = json.loads(out)
    assert code == 0
    np.testing.assert_allclose(result["start"]["t"], place.starts[1].pose.t)


def test_photo_of_another_place_ends_in_failed_with_exit_3_and_the_start_camera(place, tmp_path, capsys):
    noise = np.random.default_rng(5).integers(0, 255, (SIZE[1] // 4, SIZE[0] // 4, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "other.png"), cv2.resize(noise, SIZE, interpolation=cv2.INTER_CUBIC))
    cam = place.json(tmp_path / "cam.json", place.starts[:1])
    code, out, _ = run(capsys, "refine", place.scene, tmp_path / "other.png", "--camera", cam, "--no-locate", *FAST)
    result = json.loads(out)
    assert (code, result["verdict"]) == (3, "failed")
    np.testing.assert_allclose(result["R"], place.starts[0].pose.R, atol=1e-12)
    np.testing.assert_allclose(result["t"], place.starts[0].pose.t, atol=1e-12)
    assert result["reasons"]


def test_camera_is_fitted_to_a_photo_of_another_size(place, tmp_path, capsys):
    large = [replace(c, intrinsics=c.intrinsics.resized(4 * SIZE[0], 4 * SIZE[1])) for c in place.starts]
    cam = place.json(tmp_path / "cam.json", large[:1])
    code, out, _ = run(capsys, "refine", place.scene, place.folder / "photo_0.png", "--camera", cam, *FAST)
    result = json.loads(out)
    assert code == 0
    assert (result["width"], result["height"]) == SIZE
    assert result["fx"] == pytest.approx(place.truths[0].intrinsics.fx)


# ---- flags


def test_flags_are_the_settings(capsys):
    args = build_parser().parse_args(["refine", "s.ply", "p.jpg", "--camera", "c.json"])
    assert settings_from(args) == RefineSettings()
    more = ["--seed", "7", "--iterations", "9", "--candidates", "3", "--no-multiview", "--no-epipolar"]
    args = build_parser().parse_args(["refine", "s.ply", "p.jpg", "--camera", "c.json", *more])
    assert settings_from(args) == RefineSettings(seed=7, iterations=9, candidates=3, multiview=False, epipolar=False)
    assert main(["refine", "--help"]) == 0
    text = capsys.readouterr().out
    for field in fields(RefineSettings):
        assert field.name.replace("_", "-") in text


def documented():
    """Command to its options, as the block at the head of docs/command_line.md has them; MAP and OPTIONS stand for several."""
    page = (Path(__file__).parents[3] / "docs" / "command_line.md").read_text(encoding="utf-8")
    block = page.partition("```\n")[2].partition("```\n")[0]
    groups, commands = {}, {}
    for name, text in re.findall(r"^([A-Z]+): (.+(?:\n .+)*)", block, re.MULTILINE):
        groups[f"[{name}]"] = text
    for name, text in re.findall(r"^python -m core (\w+) (.+(?:\n .+)*)", block, re.MULTILINE):
        whole = re.sub(r"\[[A-Z]+\]", lambda match: groups.get(match[0], match[0]), text)
        commands[name] = sorted({*commands.get(name, []), *re.findall(r"--[a-z-]+", whole)})
    return commands


def test_the_page_of_the_command_line_has_every_option_of_every_command():
    subparsers = next(a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    options = {
        name: sorted(o for action in parser._actions for o in action.option_strings if o not in ("-h", "--help"))
        for name, parser in subparsers.choices.items()
    }
    assert documented() == options


def test_a_caller_may_add_options_and_gets_the_outcome(place, tmp_path, capsys):
    seen = []
    file = place.json(tmp_path / "cam.json", [replace(place.truths[0], intrinsics=Intrinsics(8, 6, 5, 5, 4, 3))])
    code = main(
        ["render", str(place.scene), file, str(tmp_path / "o"), "--blend", "x.blend"],
        prog="blender --command gssmc",
        add_options=lambda parser: parser.add_argument("--blend"),
        on_outcome=lambda args, outcome: seen.append((args.blend, outcome)),
    )
    assert code == 0
    ((blend, outcome),) = seen
    assert blend == "x.blend"
    assert outcome.scene == place.scene
    assert [c.file for c in outcome.cameras] == ["photo_0.png"]


def test_features_lists_all_with_the_reason_when_not(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(EXTRACTORS, "orb", replace(EXTRACTORS["orb"], opencv="xfeatures2d.NEVER"))
    (tmp_path / "any.onnx").write_text("x")
    code, out, err = run(capsys, "features", "--model", tmp_path / "any.onnx", "--model", tmp_path / "no.onnx")
    assert (code, err) == (0, "")
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert {*EXTRACTORS, *MATCHERS, "auto"} <= set(lines)
    assert "available" in lines["sift"] and "available" in lines["nearest"]
    assert "needs a model file (--model" in lines["aliked"]
    assert "needs a model file (--matcher-model" in lines["lightglue"]
    assert "has no cv2.xfeatures2d.NEVER" in lines["orb"]
    assert "not one of the known models" in out and "no such file" in out


def test_features_knows_no_scene_to_save(capsys):
    added, seen = [], []
    options = lambda parser: added.append(parser.prog)  # noqa: E731
    assert main(["features"], add_options=options, on_outcome=lambda *outcome: seen.append(outcome)) == 0
    assert [prog.split()[-1] for prog in added] == ["render", "refine", "locate", "batch", "demo"]
    assert seen == []


@pytest.mark.parametrize("name", ["akaze", "orb"])
def test_other_features_find_the_camera_too(place, tmp_path, capsys, name):
    cam = place.json(tmp_path / "cam.json", place.starts[:1])
    arguments = [place.scene, place.folder / "photo_0.png", "--camera", cam, *FAST, "--features", name]
    code, out, _ = run(capsys, "refine", *arguments)
    result = json.loads(out)
    assert code == 0
    found = camera_from_dict(result)
    before, after = (pose_error(p, place.truths[0].pose) for p in (place.starts[0].pose, found.pose))
    assert after[0] < 0.3 * before[0]


# ---- mistakes: exit 2, one sentence, nothing written


def mistakes(place, tmp):
    cam = place.json(tmp / "cam.json", place.starts[:1])
    many = place.json(tmp / "many.json", place.starts[1:])
    wrong_size = place.json(tmp / "wide.json", place.starts[:1], width=500)
    (tmp / "broken.json").write_text("{")
    (tmp / "name.json").write_text('{"frames": ["photo_0.png"]}')
    (tmp / "half.json").write_text('{"file": "photo_0.png", "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}')
    (tmp / "mesh.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n")
    (tmp / "text.jpg").write_text("no photo")
    photo, scene, out = place.folder / "photo_0.png", place.scene, tmp / "out"
    refine = ["refine", scene, photo, "--camera", cam]
    return {
        "no command": ([], "required: COMMAND"),
        "unknown command": (["paint"], "paint"),
        "no camera": (["refine", scene, photo, "--no-locate"], "There is no start to refine from"),
        "no pose": (["refine", scene, photo, "--camera", tmp / "name.json", "--no-locate"], "has no R and t"),
        "half a pose": (["refine", scene, photo, "--camera", tmp / "half.json"], "lacks t"),
        "batch without a pose": (["batch", scene, tmp / "name.json", "--out", out, "--no-locate"], "Camera 1 of"),
        "map options of no use": ([*refine, "--no-locate", "--views", "5"], "which --no-locate switches off"),
        "map over a photo": (["locate", scene, photo, "--map", photo], "would overwrite the photo"),
        "map over another file": (["map", scene, "--map", tmp / "text.jpg"], "is no map of a scan"),
        "map over the scan": (["map", scene, "--map", scene], "would overwrite the scan"),
        "map without views": (["map", scene, "--views", "0"], "option views is 0"),
        "map of a mesh": (["map", tmp / "mesh.ply"], "holds a mesh"),
        "known cameras that are not there": (["map", scene, "--cameras", tmp / "no.json"], "There is nothing at"),
        "known cameras that are not known": (["map", scene, "--cameras", tmp / "name.json"], "holds no camera that is known"),
        "locate with another lens": (["locate", scene, photo, "--camera", wrong_size], "but its camera 500 x 180"),
        "word for a number": ([*refine, "--seed", "x"], "--seed"),
        "out of range": ([*refine, "--iterations", "0"], "option iterations is 0"),
        "unknown features": ([*refine, "--features", "surf"], "--features"),
        "features without a model": ([*refine, "--features", "aliked"], "ALIKED needs a model file"),
        "model that is not there": ([*refine, "--features", "aliked", "--model", tmp / "no.onnx"], "There is no model file at"),
        "model that is none": ([*refine, "--features", "aliked", "--model", tmp / "text.jpg"], "'text.jpg' does not work"),
        "model for SIFT": ([*refine, "--model", tmp / "text.jpg"], "SIFT needs no model file, and 'text.jpg' is given"),
        "model for ORB": ([*refine, "--features", "orb", "--model", tmp / "no.onnx"], "ORB needs no model file"),
        "model of no matcher": ([*refine, "--matcher-model", tmp / "text.jpg"], "Nearest needs no model file"),
        "missing scene": (["refine", tmp / "no.ply", photo, "--camera", cam], "There is no splat file at"),
        "mesh": (["refine", tmp / "mesh.ply", photo, "--camera", cam], "holds a mesh"),
        "missing photo": (["refine", scene, tmp / "no.jpg", "--camera", cam], "There is no photo at"),
        "no photo": (["refine", scene, tmp / "text.jpg", "--camera", cam], "cannot be decoded"),
        "missing camera": (["refine", scene, photo, "--camera", tmp / "no.json"], "There is no camera file at"),
        "broken camera": (["refine", scene, photo, "--camera", tmp / "broken.json"], "no valid JSON"),
        "whose camera": (["refine", scene, photo, "--camera", many], "2 cameras, 0 of them for 'photo_0.png'"),
        "other shape": (["refine", scene, photo, "--camera", wrong_size], "240 x 180 pixels but its camera 500 x 180"),
        "render a mesh": (["render", tmp / "mesh.ply", cam, out], "holds a mesh"),
        "render into a file": (["render", scene, cam, tmp / "text.jpg"], "text.jpg"),
        "workers": (["batch", scene, many, "--out", out, "--workers", "0"], "--workers is 0"),
        "batch over its queries": (["batch", scene, many, "--out", many], "queries file itself"),
        "batch over another file": (["batch", scene, many, "--out", tmp / "cam.json"], "is no results file"),
        "batch without scene": (["batch", tmp / "no.ply", many, "--out", out], "There is no splat file at"),
        "batch with a mesh": (["batch", tmp / "mesh.ply", many, "--out", tmp / "new.json"], "holds a mesh"),
        "batch without queries": (["batch", scene, tmp / "no.json", "--out", out], "There is no camera file at"),
    }


def test_every_mistake_gets_exit_2_and_one_sentence(place, tmp_path, capsys):
    for argv, words in mistakes(place, tmp_path).values():
        code, out, err = run(capsys, *argv)
        assert code == 2, (argv, err)
        assert out == ""
        assert words in one_sentence(err), err
        assert not (tmp_path / "out").exists(), argv


def test_every_number_is_asked_for_in_one_sentence():
    """Of every command's options; Python takes "nan" for a number."""
    subparsers = next(a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    checked = set()
    for name, parser in subparsers.choices.items():
        for action in parser._actions:
            value = action.type("3") if action.option_strings and action.type else None
            if not isinstance(value, int | float):
                continue
            kind = "whole number" if isinstance(value, int) else "number"
            for text in ("x", "nan", "inf", "", "1e999", "-inf"):
                with pytest.raises(UsageError) as caught:
                    parser.parse_args([f"{action.option_strings[0]}={text}"])
                assert str(caught.value).startswith(f"{action.option_strings[0]}: '{text}' is no {kind}; give one, such as ")
                assert str(caught.value).endswith(f"; see 'python -m core {name} --help'.")
            checked.add((name, action.option_strings[0]))
    assert {("batch", "--focal"), ("batch", "--workers"), ("map", "--views"), ("render", "--near")} < checked


def test_a_folder_that_cannot_be_written_to_is_named(place, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    cam = place.json(tmp_path / "cam.json", place.starts[:1])
    code, _, err = run(
        capsys,
        "refine",
        place.scene,
        place.folder / "photo_0.png",
        "--camera",
        cam,
        "--out",
        tmp_path / "file" / "r.json",
        *FAST,
    )
    assert code == 2
    assert "file" in err.strip().splitlines()[-1]


def test_dropped_gaussians_are_told(place, tmp_path, capsys):
    data = bytearray(place.scene.read_bytes())
    start = data.index(b"end_header\n") + len(b"end_header\n")
    data[start : start + 4] = np.float32(np.nan).tobytes()
    (tmp_path / "nan.ply").write_bytes(data)
    cam = place.json(tmp_path / "cam.json", [replace(place.truths[0], intrinsics=Intrinsics(8, 6, 5, 5, 4, 3))])
    code, _, err = run(capsys, "render", tmp_path / "nan.ply", cam, tmp_path / "out")
    assert code == 0
    assert f"Left out 1 of {len(read_splats(place.scene))} Gaussians" in one_sentence(err)


def test_python_m_core_from_a_shell(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "core", "render", "no.ply", "no.json", str(tmp_path)],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    one_sentence(done.stderr)


def test_memory_that_is_used_up_is_told_in_a_sentence(capsys, monkeypatch):
    def run(args):
        raise MemoryError

    monkeypatch.setattr("core.cli.commands.features.run", run)
    assert main(["features"]) == 2
    assert capsys.readouterr().err.startswith("The memory is used up; end other programs")
