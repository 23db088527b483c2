"""The command line inside Blender: the engine's own, plus `--blend`."""

import argparse
import json

import numpy as np
import pytest
from samples import random_gaussians, write_photo, write_ply


@pytest.fixture
def main(bpy, extension):
    return extension("gssmc_addon.headless.command").main


@pytest.fixture
def files(tmp_path):
    """A splat, two photos of something else, and start cameras that look at the splat."""
    write_ply(tmp_path / "scan.ply", random_gaussians(300, 0))
    frames = []
    for name in ("a.png", "b.png"):
        write_photo(tmp_path / name, 60, 90)
        frame = {"file": name, "width": 60, "height": 90, "fx": 80, "fy": 80, "cx": 30, "cy": 45, "dist": [0.01, 0, 0, 0]}
        frames.append(frame | {"R": np.eye(3).tolist(), "t": [0, 0, 6.0]})
    (tmp_path / "cameras.json").write_text(json.dumps({"frames": frames}))
    return tmp_path


def flags(parser):
    """Each subcommand's flags with what they take."""
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {
        name: {word: (a.dest, a.nargs, a.choices, a.type) for a in sub._actions for word in a.option_strings or (a.dest,)}
        for name, sub in commands.choices.items()
    }


def test_blender_takes_all_that_the_plain_command_line_takes(main, extension, monkeypatch):
    cli, made = extension("core.cli.main"), []
    plain, build = flags(cli.build_parser()), cli.build_parser
    monkeypatch.setattr(cli, "build_parser", lambda *args: made.append(build(*args)) or made[0])
    assert main(["features"]) == 0
    here = flags(made[0])
    assert {name: {f: plain[name].get(f) for f in here[name]} for name in here} == {
        name: dict(flags)
        | ({"--blend": None, "--up": None} if name not in cli.WITHOUT_SCENE else {})
        | ({"--renderer": None} if name in ("refine", "locate", "demo") else {})
        for name, flags in plain.items()
    }
    assert {"--features", "--matcher", "--model", "--matcher-model", "--mask", "--lens"} <= here["batch"].keys()


def test_the_features_asked_for_are_those_that_place_the_photo(main, files, capfd):
    """ORB without a model works, a learned one without its model is refused, both before anything is drawn."""
    arguments = ["refine", str(files / "scan.ply"), str(files / "a.png"), "--camera", str(files / "cameras.json")]
    assert main([*arguments, "--features", "orb", "--matcher", "nearest", "--out", str(files / "r.json")]) == 3
    assert main([*arguments, "--features", "aliked", "--out", str(files / "s.json")]) == 2
    assert "model" in capfd.readouterr().err.splitlines()[-1]
    assert not (files / "s.json").exists()


def cameras(bpy):
    return sorted((o for o in bpy.context.scene.objects if o.type == "CAMERA"), key=lambda o: o.name)


def test_refine_saves_splat_camera_photo_and_verdict(bpy, main, files):
    out = files / "out.blend"
    arguments = ["refine", files / "scan.ply", files / "a.png", "--camera", files / "cameras.json"]
    code = main([str(a) for a in [*arguments, "--out", files / "result.json", "--blend", out, "--up", "z-up"]])
    assert code == 3, "a photo of another place must fail"
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(out))
    scene = bpy.context.scene
    (camera,) = cameras(bpy)
    assert len(scene.gssmc.splat.data.points) == 300
    image = camera.data.background_images[0].image
    assert image.filepath == "//a.png"
    assert tuple(image.size) == (60, 90)
    assert camera.data.gssmc.verdict == "FAILED"
    assert camera.data.gssmc.reasons.splitlines() == json.loads((files / "result.json").read_text())["reasons"]
    np.testing.assert_allclose(camera.matrix_world.translation, (0, 0, -6), atol=1e-5)
    assert camera.data.gssmc.k1 == pytest.approx(0.01)
    assert (scene.render.resolution_x, scene.render.resolution_y) == (60, 90)


def test_batch_saves_a_camera_for_each_photo(bpy, main, files):
    (files / "b.png").write_bytes(b"no picture")
    arguments = ["batch", files / "scan.ply", files / "cameras.json", "--out", files / "results.json", "--workers", "1"]
    assert main([str(a) for a in [*arguments, "--blend", files / "out.blend"]]) == 3
    bpy.ops.wm.open_mainfile(filepath=str(files / "out.blend"))
    assert [c.name for c in cameras(bpy)] == ["a", "b"]
    assert [c.data.gssmc.verdict for c in cameras(bpy)] == ["FAILED", "FAILED"]
    assert [len(c.data.background_images) for c in cameras(bpy)] == [1, 0]


@pytest.mark.parametrize("command", ["refine", "batch"])
def test_of_a_wide_lens_the_pinhole_of_the_middle_is_saved(bpy, main, files, command):
    """The photo does not lie behind it, for Blender would show the fisheye's picture on a pinhole."""
    lens = {"camera_model": "OPENCV_FISHEYE", "width": 60, "height": 90, "fx": 30, "fy": 30, "cx": 30, "cy": 45}
    start = {**lens, "file": "a.png", "R": np.eye(3).tolist(), "t": [0, 0, 6.0]}
    (files / "wide.json").write_text(json.dumps({"frames": [start]}))
    out = {"refine": [files / "a.png", "--camera", files / "wide.json"], "batch": [files / "wide.json", "--workers", "1"]}
    arguments = [command, files / "scan.ply", *out[command], "--no-locate", "--out", files / "result.json"]
    assert main([str(a) for a in [*arguments, "--blend", files / "out.blend", "--up", "z-up"]]) == 3
    bpy.ops.wm.open_mainfile(filepath=str(files / "out.blend"))
    (camera,) = cameras(bpy)
    assert camera.data.gssmc.verdict == "FAILED" and not camera.data.background_images
    np.testing.assert_allclose(camera.matrix_world.translation, (0, 0, -6), atol=1e-5)
    render = bpy.context.scene.render
    # A fisheye of 30 pixels a radian shows a radian to each side, of which the cut takes 50 degrees.
    assert (render.resolution_x, render.resolution_y) == (int(60 * np.tan(np.radians(50))),) * 2
    record = json.loads((files / "result.json").read_text())
    assert (record["frames"][0] if command == "batch" else record)["camera_model"] == "OPENCV_FISHEYE"


def test_render_saves_its_cameras(bpy, main, files):
    code = main(
        [
            "render",
            str(files / "scan.ply"),
            str(files / "cameras.json"),
            str(files / "drawn"),
            "--blend",
            str(files / "o.blend"),
        ]
    )
    assert code == 0
    bpy.ops.wm.open_mainfile(filepath=str(files / "o.blend"))
    assert [c.name for c in cameras(bpy)] == ["a", "b"]


def test_without_blend_the_open_scene_stays(bpy, main, files):
    bpy.data.objects.new("mine", None)
    assert main(["render", str(files / "scan.ply"), str(files / "cameras.json"), str(files / "drawn")]) == 0
    assert "mine" in bpy.data.objects
    assert not bpy.data.pointclouds


@pytest.mark.parametrize("blend", ["nowhere/out.blend"])
def test_a_folder_that_is_missing_is_told_before_the_work(main, files, capfd, blend):
    arguments = ["render", str(files / "scan.ply"), str(files / "cameras.json"), str(files / "drawn")]
    assert main([*arguments, "--blend", str(files / blend)]) == 2
    assert len(capfd.readouterr().err.strip().splitlines()) == 1
    assert not (files / "drawn").exists()


def test_batch_runs_nothing_of_the_folder_that_blender_was_started_in(main, files, monkeypatch):
    """It may be a downloaded scan's."""
    trap = files / "downloaded"
    for name in ("json.py", "numpy.py", "core/__init__.py"):
        (trap / name).parent.mkdir(parents=True, exist_ok=True)
        (trap / name).write_text(f"import pathlib; pathlib.Path({str(files / 'sprung')!r}).touch(); raise SystemExit(9)")
    monkeypatch.chdir(trap)
    arguments = [files / "scan.ply", files / "cameras.json", "--out", files / "r.json", "--workers", "2"]
    assert main(["batch", *map(str, arguments)]) == 3, "photos of another place must fail"
    frames = json.loads((files / "r.json").read_text())["frames"]
    assert [("error" in frame, frame["verdict"]) for frame in frames] == [(False, "failed")] * 2
    assert not (files / "sprung").exists()


@pytest.mark.parametrize(("lens", "state"), [("solved", "SOLVED"), ("shared", "SOLVED"), ("given", "CALIBRATED")])
def test_a_solved_camera_is_saved_with_what_it_was_solved_to_be(bpy, extension, files, lens, state):
    """By the report that a refinement ends with; the saved file knows when the camera is moved."""
    reports, outcome = extension("core.pose.report"), extension("core.cli.outcome")
    (camera, *_) = extension("core.cameras.files").read_cameras(files / "cameras.json")
    evidence = {name: 1.0 for name in reports.PoseQuality.__dataclass_fields__}
    start = extension("core.geometry.camera").Camera(camera.intrinsics, extension("core.geometry.camera").Pose())
    quality, numbers = reports.PoseQuality(**evidence), (reports.LensNumber("focal", lens, 80.0, 0.1),)
    report = reports.RefineReport(camera, start, "trusted", ("It sits.",), (), 1.0, quality, "joint", numbers)
    made = outcome.Outcome(0, files / "scan.ply", (camera,), (files / "a.png",), (report,))
    extension("gssmc_addon.headless.blend_file").save(files / "out.blend", made, None, "Z_UP")
    bpy.ops.wm.open_mainfile(filepath=str(files / "out.blend"))
    scene, solution = bpy.context.scene, extension("gssmc_addon.camera.solution")
    bpy.context.view_layer.update()
    note = scene.camera.data.gssmc
    assert (solution.verdict(scene, scene.camera), note.lens_state) == ("TRUSTED", state)
    scene.camera.location.x += 0.1
    bpy.context.view_layer.update()
    assert solution.verdict(scene, scene.camera) == "CHANGED"
