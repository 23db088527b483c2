"""Whether a camera still is what it was solved to be: worked out from where it stands, said wherever verdicts are said."""

import json
import re
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest
import rooms
from panels_drawn import drawn
from samples import random_gaussians, write_photo, write_ply

DEPTH = 5.0


@pytest.fixture
def apply(bpy, extension):
    """Writes the end of a refinement as the job does: verdict, what of the lens was solved for, and a camera."""
    engine, reports = extension("core.geometry.camera"), extension("core.pose.report")
    jobs, lie = extension("gssmc_addon.refine.job"), extension("core.geometry.lie")
    evidence = {name: 1.0 for name in reports.PoseQuality.__dataclass_fields__}
    quality = reports.PoseQuality(**evidence | {"median_depth": DEPTH})

    def write(verdict="trusted", lens="solved", camera=None, focal=80.0, quality=quality, reasons=("It sits.",)):
        scene = bpy.context.scene
        camera = camera or scene.camera
        found = engine.Camera(
            engine.Intrinsics(60, 90, focal, focal, 31.0, 44.0, (0.05, 0, 0, 0, 0)),
            engine.Pose(lie.so3_exp(np.array([0.3, -0.2, 0.1])), np.array([0.4, -0.1, DEPTH])),
        )
        start = extension("gssmc_addon.camera.bridge").read_camera(scene, camera, scene.gssmc.splat).at_size(60, 90)
        end = start if verdict == "failed" else found
        numbers = (reports.LensNumber("focal", lens, focal, 0.1),)
        report = reports.RefineReport(end, start, verdict, reasons, (), 3.0, quality, "joint", numbers)
        photo = extension("gssmc_addon.photo.image").camera_photo(camera)
        jobs.apply_report(jobs.Targets.of(scene, scene.gssmc.splat, camera, photo), report)
        bpy.context.view_layer.update()
        return found

    return write


@pytest.fixture
def solved(bpy, scene, apply):
    """The scene's camera, trusted."""
    apply()
    return scene.camera


@pytest.fixture
def now(bpy, extension):
    """What holds of the scene's camera now: its verdict, and what changed."""
    solution = extension("gssmc_addon.camera.solution")

    def ask():
        bpy.context.view_layer.update()
        scene = bpy.context.scene
        return solution.verdict(scene, scene.camera), solution.change(scene, scene.camera)

    return ask


SAME, MOVED, LENS, PHOTO, SPLAT = [("TRUSTED", "")] + [("CHANGED", what) for what in ("MOVED", "LENS", "PHOTO", "SPLAT")]


def photo_pose(bpy, extension):
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    return extension("gssmc_addon.camera.bridge").read_camera(scene, scene.camera, scene.gssmc.splat).at_size(60, 90)


def move(camera):
    camera.location.x += 0.01 * DEPTH


def turn(camera):
    camera.rotation_euler.z += np.radians(0.05)


def set_lens(camera):
    camera.data.lens *= 1.001


def set_shift(camera):
    camera.data.shift_y += 0.001


def set_sensor(camera):
    camera.data.sensor_width *= 1.01


def bend(camera):
    camera.data.gssmc.k1 += 0.001


def make_orthographic(camera):
    camera.data.type = "ORTHO"


def shear(camera):
    """By a parent that is scaled unevenly."""
    import bpy

    camera.parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(camera.parent)
    camera.parent.scale = (1, 3, 1)


CHANGES = {move: MOVED, turn: MOVED, set_lens: LENS, set_shift: LENS, set_sensor: LENS, bend: LENS}


def test_a_solved_camera_is_trusted_until_it_is_changed(bpy, extension, solved, now):
    assert now() == SAME
    said = drawn(bpy, extension)
    assert "Trusted: 3.0 s" in said
    assert "gssmc.back_to_solution" not in said


@pytest.mark.parametrize("alter", [*CHANGES, make_orthographic, shear], ids=lambda alter: alter.__name__)
def test_what_changed_is_said_and_can_be_taken_back(bpy, extension, solved, now, alter):
    before, lines = photo_pose(bpy, extension), len(drawn(bpy, extension))
    alter(solved)
    assert now() == CHANGES.get(alter, MOVED)
    said = drawn(bpy, extension)
    assert said.count("gssmc.back_to_solution") == 1
    assert any("since it was solved" in text for text in said)
    assert len(said) == lines, "the panel keeps its height"
    if alter in (make_orthographic, shear):
        return
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert now() == SAME
    after = photo_pose(bpy, extension)
    distance, degrees = extension("core.geometry.camera").pose_error(after.pose, before.pose)
    assert (distance < 1e-5, degrees < 1e-4) == (True, True)
    np.testing.assert_allclose(after.intrinsics.matrix, before.intrinsics.matrix, rtol=1e-5)
    assert after.intrinsics.dist == pytest.approx(before.intrinsics.dist)


def test_a_constraint_or_an_uneven_parent_refuses_the_way_back(bpy, solved, now):
    shear(solved)
    with pytest.raises(RuntimeError, match="scaled unevenly"):
        bpy.ops.gssmc.back_to_solution()
    solved.parent = None
    solved.constraints.new("TRACK_TO").target = bpy.context.scene.gssmc.splat
    with pytest.raises(RuntimeError, match="Track To"):
        bpy.ops.gssmc.back_to_solution()


@pytest.mark.parametrize("figure", [np.nan, np.inf])
def test_a_figure_that_nobody_knows_reaches_nobody(bpy, extension, scene, apply, now, tmp_path, capfd, figure):
    """Every figure of the evidence is unknown, or without a bound: in the panel, the report, an export and Report a Problem."""
    reports, judge = extension("core.pose.report"), extension("core.pose.verdict.verdict").judge
    details = extension("core.pose.verdict.sentences").details
    kinds = {field.name: field.type for field in fields(reports.PoseQuality)}
    evidence = {name: figure if kind == "float" else 100 for name, kind in kinds.items()}
    quality = reports.PoseQuality(**evidence | {"of": "refined", "pose": extension("core.geometry.camera").Pose()})
    for verdict in ("failed", "check"):
        apply(verdict, quality=quality, reasons=(*judge(quality)[1], *details(quality)))
        shown = drawn(bpy, extension)
        problem = extension("gssmc_addon.support.problem").text(bpy.context)
        for text in (shown, problem, capfd.readouterr().out, scene.camera.data.gssmc.solution, scene.camera.data.gssmc.reasons):
            assert not re.search(r"\b(nan|NaN|inf|Infinity)\b", str(text)), text
    assert now() == ("CHECK", "")


def test_another_photo_is_said_and_the_solved_one_comes_back(bpy, extension, solved, now, tmp_path):
    photo = solved.data.gssmc.photo
    photo.name = "renamed"
    assert now() == SAME
    solved.data.gssmc.photo = bpy.data.images.load(str(write_photo(tmp_path / "other.png", 80, 60)))
    assert now() == PHOTO
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert solved.data.gssmc.photo == photo
    assert photo in [slot.image for slot in solved.data.background_images]
    assert now() == SAME


def test_a_photo_whose_file_got_another_shape_is_another(bpy, solved, now, tmp_path):
    write_photo(tmp_path / "a.png", 80, 60)
    solved.data.gssmc.photo.reload()
    assert tuple(solved.data.gssmc.photo.size) == (80, 60)
    assert now() == PHOTO


def test_another_resolution_changes_nothing_in_either_direction(bpy, solved, now):
    """Float32 rounds at each; all of it together is no change."""
    render = bpy.context.scene.render
    for number in range(40):
        render.resolution_x, render.resolution_y = ((1080, 1920), (777, 333), (1920, 1080))[number % 3]
        assert now() == SAME
    assert bpy.ops.gssmc.match_resolution() == {"FINISHED"}
    assert now() == SAME


def test_camera_and_splat_may_move_together_and_not_apart(bpy, scene, solved, now):
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    bpy.context.view_layer.update()
    for obj in (solved, scene.gssmc.splat):
        obj.parent = parent
    parent.location, parent.rotation_euler, parent.scale = (50, -20, 3), (0.4, 1.2, -0.6), (0.3,) * 3
    assert now() == SAME
    scene.gssmc.splat.location.y += 0.1
    assert now() == MOVED
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert now() == SAME


@pytest.mark.parametrize("place", [1e3, 1e5])
def test_a_scene_far_from_the_origin_is_judged_by_what_blender_can_hold(bpy, scene, apply, now, place):
    scene.gssmc.splat.location, scene.gssmc.splat.rotation_euler = (place, -place, 10), (0.4, 0.2, 1.0)
    bpy.context.view_layer.update()
    apply()
    assert now() == SAME
    scene.camera.location.x += 0.1
    assert now() == MOVED


@pytest.mark.parametrize("mode", ["XYZ", "ZXY", "QUATERNION", "AXIS_ANGLE"])
def test_no_rotation_mode_looks_like_a_move(bpy, scene, apply, now, mode):
    scene.camera.rotation_mode = mode
    for degrees in (0, 37, 90, 180):
        scene.gssmc.splat.rotation_euler = (np.radians(degrees), np.radians(degrees / 2), 0)
        bpy.context.view_layer.update()
        apply()
        assert now() == SAME


def test_another_splat_is_said(bpy, solved, now, tmp_path):
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "other.ply", random_gaussians(50, 0))), orientation="Z_UP")
    scene = bpy.context.scene
    scan = bpy.data.objects["scan"]
    scene.gssmc.splat = bpy.data.objects["other"]
    assert now() == SPLAT
    scene.gssmc.splat = scan
    assert now() == SAME
    scene.gssmc.splat = None
    assert now() == SPLAT
    with pytest.raises(RuntimeError, match="import or pick the splat"):
        bpy.ops.gssmc.back_to_solution()


def test_undo_files_and_names_lose_nothing(bpy, solved, now, tmp_path):
    bpy.ops.ed.undo_push(message="solved")
    move(solved)
    bpy.ops.ed.undo_push(message="moved")
    assert now() == MOVED
    bpy.ops.ed.undo()
    assert now() == SAME
    bpy.ops.ed.redo()
    assert now() == MOVED
    scene = bpy.context.scene
    scene.camera.name, scene.camera.data.name, scene.gssmc.splat.name = "shot", "shot lens", "place"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert now() == MOVED
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert now() == SAME
    assert bpy.context.scene.camera.data.gssmc.photo.name == "a.png"


def test_a_camera_in_an_excluded_collection_stands_where_it_stands(bpy, extension, scene, solved, now, tmp_path):
    """Blender does not work out the place of such an object in a file that was just opened."""
    parent = bpy.data.objects.new("parent", None)
    away = bpy.data.collections.new("away")
    scene.collection.children.link(away)
    for obj in (solved, scene.gssmc.splat, parent):
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        away.objects.link(obj)
    bpy.context.view_layer.update()
    solved.parent = parent
    parent.location, parent.rotation_euler = (3, 1, 2), (0.1, 0.2, 0.3)
    scene.gssmc.splat.parent = parent
    assert now() == SAME
    before = photo_pose(bpy, extension)
    bpy.context.view_layer.layer_collection.children["away"].exclude = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert now() == SAME
    distance, degrees = extension("core.geometry.camera").pose_error(photo_pose(bpy, extension).pose, before.pose)
    assert (distance < 1e-5, degrees < 1e-3) == (True, True)


def test_a_failed_try_from_elsewhere_keeps_the_way_back(bpy, extension, solved, apply, now):
    move(solved)
    bpy.context.view_layer.update()
    apply("failed")
    assert now() == ("FAILED", "MOVED")
    assert "Failed: 3.0 s" in drawn(bpy, extension)
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert now() == SAME


def test_a_new_photo_for_the_camera_forgets_the_solution(bpy, solved, now, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "b.png")), camera="SCENE")
    assert now() == ("NONE", "")
    assert not bpy.ops.gssmc.back_to_solution.poll()


def test_without_its_camera_the_way_back_says_what_to_do(bpy, scene, solved, tmp_path):
    bpy.data.objects.remove(solved)
    with pytest.raises(RuntimeError, match="The scene has no camera; undo its removal, or pick another photo on the list"):
        bpy.ops.gssmc.back_to_solution()
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "b.png")), camera="NEW")
    with pytest.raises(RuntimeError, match="was never solved; use Find Camera or Refine Camera"):
        bpy.ops.gssmc.back_to_solution()


@pytest.mark.parametrize("record", ["{", "[]", "{}", '{"fx": 1}', "7"])
def test_a_damaged_record_is_no_record(bpy, solved, now, record):
    solved.data.gssmc.solution = record
    assert now() == SAME, "what was said of the camera"
    with pytest.raises(RuntimeError, match="was never solved"):
        bpy.ops.gssmc.back_to_solution()


def test_list_review_and_queue_know(bpy, extension, scene, apply, now, tmp_path):
    scene.gssmc.photos.clear()
    for name in "bcd":
        bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / f"{name}.png")), camera="NEW")
        apply()
    own = scene.gssmc
    queue = extension("gssmc_addon.photo.queue")
    with pytest.raises(extension("core.errors").RefineError, match="trusted already"):
        queue.entries_to_refine(scene, "OPEN")
    move(own.photos[1].camera)
    bpy.context.view_layer.update()
    assert [entry.camera.name for entry in queue.entries_to_refine(scene, "OPEN")] == ["c"]
    own.photo_index = 2
    bpy.ops.gssmc.review(step=1, skip_trusted=True)
    assert own.photo_index == 1
    lines = extension("gssmc_addon.photo.panel").GSSMC_UL_photos
    icons = []
    row = SimpleNamespace(
        prop=lambda *_, **__: None, label=lambda text="", icon="NONE", **_: icons.append(icon), row=lambda **_: row
    )
    for entry in own.photos:
        lines.draw_item(None, bpy.context, row, own, entry, 0, own, "photo_index", 0)
    assert [icon for icon in icons if icon in ("CHECKMARK", "LOOP_BACK")] == ["CHECKMARK", "LOOP_BACK", "CHECKMARK"]


def test_an_export_says_what_no_longer_holds(bpy, solved, tmp_path, capfd):
    move(solved)
    bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "out.json"))
    (record,) = json.loads((tmp_path / "out.json").read_text())["frames"]
    assert (record["verdict"], record["reasons"]) == ("changed", ["Moved since it was solved.", "It sits."])
    assert "1 are no longer as they were solved: a." in capfd.readouterr().out


def lock(bpy):
    spaces = [s for screen in bpy.data.screens for area in screen.areas for s in area.spaces if s.type == "VIEW_3D"]
    for space in spaces:
        space.lock_camera = True
    return spaces


def test_moving_with_the_view_ends_with_a_solution(bpy, extension, scene, apply):
    spaces = lock(bpy)
    if not spaces:
        pytest.skip("this Blender has no viewport in background mode")
    apply("failed")
    assert all(space.lock_camera for space in spaces), "the start is still to be found"
    apply()
    assert not any(space.lock_camera for space in spaces)
    lock(bpy)
    extension("gssmc_addon.photo.list").show(bpy.context, scene)  # Next and Previous come to a solved camera
    assert not any(space.lock_camera for space in spaces)


# The lens: guessed, solved, or calibrated, and only the user says the last.


def solves(bpy, extension):
    """Whether Refine would solve for the lens when Solve For is Auto."""
    scene, settings = bpy.context.scene, extension("core.pose.settings").RefineSettings()
    job = extension("gssmc_addon.refine.job").prepare(scene, scene.gssmc.splat, scene.camera, settings)
    return extension("core.pose.refine").solves_lens(settings, job.inputs.camera.at_size(60, 90))


@pytest.mark.parametrize("verdict", ["trusted", "check"])
def test_a_solved_lens_is_a_start_and_no_calibration(bpy, extension, scene, apply, verdict):
    note = scene.camera.data.gssmc
    assert (note.lens_state, solves(bpy, extension)) == ("GUESSED", True)
    apply(verdict, focal=80.0)
    assert (note.lens_state, solves(bpy, extension)) == ("SOLVED", True)
    assert photo_pose(bpy, extension).intrinsics.fx == pytest.approx(80, rel=1e-6)
    apply("failed")
    assert note.lens_state == "SOLVED"


def test_a_calibration_is_held_and_stays_one(bpy, extension, scene, apply):
    note = scene.camera.data.gssmc
    note.lens_state = "CALIBRATED"
    assert not solves(bpy, extension)
    apply(lens="given")
    assert note.lens_state == "CALIBRATED"
    apply(lens="solved")
    assert note.lens_state == "SOLVED", "the value is no longer the user's"


def test_the_way_back_restores_what_was_said_of_the_lens(bpy, solved):
    solved.data.gssmc.lens_state = "GUESSED"
    move(solved)
    bpy.ops.gssmc.back_to_solution()
    assert solved.data.gssmc.lens_state == "SOLVED"


def test_files_and_scripts_of_older_versions_are_read_over(bpy, solved):
    note = solved.data.gssmc
    note.lens_calibrated = True  # as a script says it
    assert note.lens_state == "CALIBRATED"
    note.property_unset("lens_said")  # as an older version left it: Refine had ticked it by itself
    assert note.lens_state == "SOLVED"
    note.verdict = "NONE"
    assert note.lens_state == "CALIBRATED"
    note.lens_calibrated = False
    assert note.lens_state == "GUESSED"


def test_a_calibration_of_an_older_version_outlives_a_refinement(bpy, scene, apply):
    note = scene.camera.data.gssmc
    note.lens_calibrated = True
    note.property_unset("lens_said")
    apply(lens="given")
    assert note.lens_state == "CALIBRATED"


def test_a_refined_camera_is_kept_by_the_whole_way(bpy, extension, listed, now):
    """Through the operators, with the engine."""
    assert bpy.ops.gssmc.refine(**rooms.QUICK) == {"FINISHED"}
    verdict, changed = now()
    assert (verdict in ("TRUSTED", "CHECK"), changed) == (True, "")
    bpy.context.scene.camera.location.z += 0.05
    assert now() == MOVED
    assert bpy.ops.gssmc.back_to_solution() == {"FINISHED"}
    assert now() == (verdict, "")


def test_a_background_that_was_moved_is_shown_as_it_is_with_its_verdict(bpy, scene, extension):
    """A photo that is scaled, shifted, flipped or cropped looks misplaced on the splat that it fits."""
    data, jobs = scene.camera.data, extension("gssmc_addon.refine.job")
    reports, bridge = extension("core.pose.report"), extension("gssmc_addon.camera.bridge")
    images = extension("gssmc_addon.photo.image")
    slot = data.background_images[0]

    def disturb():
        slot.frame_method, slot.offset, slot.scale, slot.rotation = "CROP", (0.1, 0.2), 1.5, 0.3
        slot.use_flip_x = slot.use_flip_y = True
        slot.alpha = 0.9

    def end(verdict):
        camera = bridge.read_camera(scene, scene.camera, scene.gssmc.splat).at_size(60, 90)
        report = reports.RefineReport(camera, camera, verdict, ("It sits.",), (), 3.0)
        targets = jobs.Targets.of(scene, scene.gssmc.splat, scene.camera, images.camera_photo(scene.camera))
        return jobs.apply_report(targets, report)

    assert "reset" not in end("trusted")
    disturb()
    assert "reset" not in end("failed") and not images.is_straight(data), "a camera that was not found stays as it was"
    assert "The background image had an offset, scale, rotation, flip or crop of its own, which was reset." in end("trusted")
    assert (slot.frame_method, *slot.offset, slot.scale, slot.rotation) == ("FIT", 0, 0, 1, 0)
    assert not (slot.use_flip_x or slot.use_flip_y)
    assert slot.alpha == pytest.approx(0.9), "how strongly it shows is the user's"
    disturb()
    data.gssmc.photo = data.gssmc.photo
    assert images.is_straight(data)
