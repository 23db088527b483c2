"""Jobs beside Blender: whose they are, what ends them, and that nothing of them is left behind."""

import logging

import numpy as np
import pytest
from by_hand import Context, event, operator, tick_to_end
from samples import counts, random_gaussians, write_photo, write_ply

BROKEN = "The work broke off through a fault of the extension; the system console has the details."
MODULE = "bl_ext.user_default.gssmc"
IMPORT = {"orientation": "AUTO", "scale": 1.0, "max_shown": 1000, "level": 0, "show_colours": False, "wait": False}


@pytest.fixture
def context(bpy):
    return Context(bpy)


@pytest.fixture
def slot(extension, bpy):
    slot = extension("gssmc_addon.jobs.slot")
    yield slot
    if slot.active():
        job = slot.active()
        slot.stop(job)
        assert job.join(60)


@pytest.fixture
def refining(bpy, scene, extension, context, slot):
    """Refine Camera, begun in the window."""
    hand = operator(bpy, extension("operators.refine").GSSMC_OT_refine, splat="", camera="", locate=False)
    assert hand.invoke(context, event()) == {"RUNNING_MODAL"}
    return hand


def importing(bpy, extension, context, path):
    """Import Gaussian Splats after its file browser."""
    cls = extension("operators.import_splats").GSSMC_OT_import_splats
    return operator(bpy, cls, filepath=str(path), **IMPORT)


def adding(bpy, extension, path):
    hand = operator(bpy, extension("operators.add_photo_folder").GSSMC_OT_add_photo_folder, directory=str(path), camera_file="")
    hand.asked = True
    return hand


# ---- whose job it is


def test_what_a_file_browser_begins_while_a_job_runs_is_refused_and_touches_nothing(
    bpy, extension, context, slot, refining, tmp_path, splat_file, monkeypatch
):
    """Blender does not poll again after the browser. The panel is seen, but shows the running job's progress."""
    monkeypatch.setattr(extension("gssmc_addon.jobs.operator"), "panel_is_open", lambda _: True)
    (tmp_path / "photos").mkdir()
    write_photo(tmp_path / "photos" / "b.png")
    job, before = slot.active(), counts(bpy)
    for other in (importing(bpy, extension, context, splat_file), adding(bpy, extension, tmp_path / "photos")):
        assert other.execute(context) == {"CANCELLED"}
        assert [level for level, _ in other.said] == ["ERROR"]
        assert "is running; wait for it or cancel it" in other.said[0][1]
        assert other.modal(context, event()) == {"CANCELLED"}, "it has nothing to follow"
    assert slot.active() is job
    assert not job.cancelled
    assert bpy.context.window_manager.gssmc.message == "", "the line is the running job's"
    assert counts(bpy) == before


def test_closing_another_browser_leaves_the_running_job_alone(bpy, extension, context, slot, refining, tmp_path):
    other = adding(bpy, extension, tmp_path)
    other.cancel(context)
    assert slot.active() is refining._job
    assert not slot.active().cancelled


def test_an_operator_does_not_apply_anothers_result(bpy, extension, context, slot, refining, scene):
    """What was begun in a later slot is nothing to the operator of an earlier one."""
    first = refining._job
    slot.stop(first)
    later = operator(bpy, extension("operators.refine").GSSMC_OT_refine, splat="", camera="", locate=False)
    assert later.invoke(context, event()) == {"RUNNING_MODAL"}
    assert refining.modal(context, event()) == {"CANCELLED"}
    assert slot.active() is later._job is not first
    assert tick_to_end(later, context) == {"CANCELLED"}, "a photo of another place"
    assert scene.camera.data.gssmc.verdict == "FAILED"


def test_the_slot_takes_one_job(bpy, extension, context, slot, refining):
    other = extension("gssmc_addon.jobs.machine").Job()
    with pytest.raises(extension("core.errors").GssmcError, match="is running"):
        slot.begin(context, other)
    assert slot.active() is refining._job


def test_a_plate_from_a_browser_waits_for_the_job(bpy, extension, context, slot, refining, tmp_path):
    cls = extension("operators.add_plate").GSSMC_OT_add_plate
    plate = operator(bpy, cls, filepath=str(tmp_path / "none.mp4"), camera="AUTO", camera_file="", set_resolution=False)
    assert plate.execute(context) == {"CANCELLED"}
    assert "is running" in plate.said[0][1]


# ---- Esc and Cancel


@pytest.mark.parametrize("way", ["ESC", "cancel"])
def test_a_stop_frees_the_slot_and_moves_nothing(bpy, context, slot, refining, scene, way):
    job, before = slot.active(), np.array(scene.camera.matrix_world)
    if way == "cancel":
        assert bpy.ops.gssmc.cancel() == {"FINISHED"}
    assert refining.modal(context, event(way, "PRESS") if way == "ESC" else event()) == {"CANCELLED"}
    assert slot.active() is None
    assert job.join(60)
    assert (np.array(scene.camera.matrix_world) == before).all()
    assert scene.camera.data.gssmc.verdict == "NONE"
    assert "cancelled" in refining.said[-1][1]


def test_the_release_of_esc_stops_nothing(context, slot, refining):
    """It is what comes here of the Esc that closed a menu or a dialog."""
    assert refining.modal(context, event("ESC", "RELEASE")) == {"PASS_THROUGH"}
    assert not slot.active().cancelled


# ---- what nobody foresaw


def broken(*_, **__):
    raise KeyError("deep inside")


@pytest.mark.parametrize("where", ["check", "advance", "on_progress", "apply", "stopped", "make_job"])
def test_any_exception_ends_the_job_as_one_sentence(bpy, extension, context, slot, scene, caplog, where):
    hand = operator(bpy, extension("operators.refine").GSSMC_OT_refine, splat="", camera="", locate=False)
    if where == "make_job":
        hand.make_job = broken
    with caplog.at_level(logging.ERROR):
        result = hand.invoke(context, event())
        if where in ("apply", "stopped"):
            setattr(hand, where, broken)
        elif where != "make_job":
            setattr(hand._job, where, broken)
        if where == "stopped":
            result = hand.modal(context, event("ESC", "PRESS"))
        elif where != "make_job":
            job = hand._job
            result = tick_to_end(hand, context)
            assert job.cancelled
    assert slot.active() is None
    assert result == {"FINISHED"}, "an undo step of its own, should it have come in the middle of writing"
    assert hand.said == [("ERROR", BROKEN)]
    assert "deep inside" in caplog.text and "Traceback" in caplog.text
    assert bpy.ops.gssmc.refine.poll(), "the next one may begin"


@pytest.mark.parametrize("where", ["close", "cancel"])
def test_what_breaks_at_the_very_end_keeps_no_slot_and_loses_no_result(bpy, context, slot, refining, scene, caplog, where):
    job = refining._job
    setattr(job, where, broken)
    if where == "close":
        assert tick_to_end(refining, context) == {"CANCELLED"}
        assert scene.camera.data.gssmc.verdict == "FAILED"
    else:
        assert refining.modal(context, event("ESC", "PRESS")) == {"CANCELLED"}
        type(job).cancel(job)
    assert slot.active() is None
    assert "deep inside" in caplog.text
    assert job.join(60)


def test_an_exception_of_a_script_is_one_sentence_too(bpy, extension, scene, slot, monkeypatch):
    monkeypatch.setattr(extension("operators.refine").GSSMC_OT_refine, "apply", broken)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.refine(locate=False)
    assert BROKEN in str(error.value)
    assert "Traceback" not in str(error.value)


def test_an_exception_of_an_operator_without_a_job_is_one_sentence(bpy, extension, tmp_path, monkeypatch):
    monkeypatch.setattr(extension("operators.add_photo").GSSMC_OT_add_photo, "set_behind", broken)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")))
    assert BROKEN in str(error.value)
    assert "Traceback" not in str(error.value)


def test_one_photo_that_breaks_unforeseen_does_not_end_the_others(bpy, extension, scene, tmp_path, monkeypatch):
    module, folder = extension("gssmc_addon.photo.image"), tmp_path / "photos"
    folder.mkdir()
    for name in ("b.png", "c.png", "d.png"):
        write_photo(folder / name)
    load = module.load_image
    monkeypatch.setattr(module, "load_image", lambda path, photo: broken() if "c.png" in path else load(path, photo))
    assert bpy.ops.gssmc.add_photo_folder(directory=str(folder)) == {"FINISHED"}
    assert [entry.error for entry in scene.gssmc.photos if entry.error] == [BROKEN]
    assert len([o for o in scene.objects if o.type == "CAMERA"]) == 3, "the one that was there, b and d"


def test_a_thread_that_cannot_start_frees_the_slot(bpy, extension, context, slot, scene, monkeypatch):
    import threading

    def full(_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", full)
    hand = operator(bpy, extension("operators.refine").GSSMC_OT_refine, splat="", camera="", locate=False)
    assert hand.invoke(context, event()) == {"FINISHED"}
    assert slot.active() is None
    assert BROKEN in hand.said[0][1]


# ---- imports and downloads are jobs


def operators(bpy, extension):
    for module in extension("gssmc_addon")._class_modules:
        for cls in module.classes:
            if issubclass(cls, bpy.types.Operator):
                yield cls


def test_a_dialog_that_is_closed_before_anything_ran_leaves_quietly(bpy, extension, context):
    closed = 0
    for cls in operators(bpy, extension):
        hand = operator(bpy, cls)
        if hasattr(hand, "cancel"):
            assert hand.cancel(context) is None
            closed += 1
    assert closed >= 8


def test_an_import_in_the_window_is_a_job(bpy, extension, context, slot, splat_file):
    hand = importing(bpy, extension, context, splat_file)
    hand.asked = True
    assert extension("gssmc_addon.jobs.operator").JobOperator.begin(hand, context) == {"RUNNING_MODAL"}
    job = slot.active()
    assert "scan.ply" in job.status
    assert not bpy.ops.gssmc.import_splats.poll()
    assert tick_to_end(hand, context) == {"FINISHED"}
    assert slot.active() is None
    assert len(bpy.context.scene.gssmc.splat.data.points) == 200
    assert hand.said == [("INFO", '"scan": 200 Gaussians, SH degree 1 (ply).')]
    assert hand._job is None, "the operator outlives its work in Blender's history"


@pytest.mark.parametrize("ticks", [0, 1, 2, 4, 8])
def test_an_import_stopped_at_any_moment_leaves_nothing(bpy, extension, context, slot, tmp_path, monkeypatch, ticks):
    monkeypatch.setattr(extension("gssmc_addon.splat.import_job"), "STEP_S", -1.0)
    monkeypatch.setattr(extension("gssmc_addon.splat.importer"), "ADDING_S", -1.0)  # one attribute per tick
    path, before = write_ply(tmp_path / "large.ply", random_gaussians(20_000, 3)), counts(bpy)
    hand = importing(bpy, extension, context, path)
    assert hand.begin(context) == {"RUNNING_MODAL"}
    job = slot.active()
    for _ in range(ticks):
        job.join(0.2)
        assert hand.modal(context, event()) == {"PASS_THROUGH"}
    assert hand.modal(context, event("ESC", "PRESS")) == {"CANCELLED"}
    assert job.join(10), "the thread ends while it reads"
    assert slot.active() is None
    assert counts(bpy) == before
    assert hand.said == [("INFO", "The import was cancelled; nothing was changed.")]


def test_a_bad_file_in_the_window_is_said_once_and_leaves_nothing(bpy, extension, context, slot, tmp_path):
    path, before = tmp_path / "bad.ply", counts(bpy)
    path.write_bytes(write_ply(path, random_gaussians(50, 0)).read_bytes()[:-100])
    hand = importing(bpy, extension, context, path)
    assert hand.begin(context) == {"RUNNING_MODAL"}
    assert tick_to_end(hand, context) == {"CANCELLED"}
    assert [level for level, _ in hand.said] == ["ERROR"]
    assert counts(bpy) == before


@pytest.mark.parametrize("how", ["another file", "a new file", "switched off", "window closed"])
def test_what_ends_from_outside_leaves_no_job_and_no_data(bpy, extension, context, slot, tmp_path, monkeypatch, how):
    monkeypatch.setattr(extension("gssmc_addon.splat.import_job"), "STEP_S", -1.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    hand = importing(bpy, extension, context, write_ply(tmp_path / "large.ply", random_gaussians(20_000, 3)))
    assert hand.begin(context) == {"RUNNING_MODAL"}
    job = slot.active()
    while not bpy.data.pointclouds:
        assert hand.modal(context, event()) == {"PASS_THROUGH"}
    if how == "another file":
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    elif how == "a new file":
        bpy.ops.wm.read_homefile(use_empty=True)
    elif how == "switched off":
        import addon_utils

        addon_utils.disable(MODULE)
        assert not bpy.data.pointclouds
        addon_utils.enable(MODULE)
    else:
        hand.cancel(context)
    assert job.cancelled
    assert job.join(10)
    assert slot.active() is None
    assert not bpy.data.pointclouds
    assert bpy.ops.gssmc.import_splats.poll()


def test_a_scene_deleted_while_cameras_are_imported_ends_it_and_takes_them_back(bpy, extension, context, slot, scene, place):
    module = extension("gssmc_addon.camera.import_job")
    room, _, starts = place
    job = module.CameraImport(scene, starts, room.folder / "photos", True)
    before = counts(bpy), tuple(scene.render.resolution_x for _ in range(1))
    job.start()
    while job.tick() is None:
        job.join(0.05)
    assert counts(bpy)["cameras"] > before[0]["cameras"]
    bpy.context.window.scene = other = bpy.data.scenes.new("other")
    bpy.data.scenes.remove(scene)
    with pytest.raises(extension("core.errors").CameraError, match="removed"):
        job.finish()
    job.cancel()
    job.close()
    assert other and counts(bpy)["cameras"] == before[0]["cameras"]
    assert not bpy.data.collections.get(starts.stem)


def test_cancelled_cameras_give_the_render_its_size_back(bpy, extension, slot, scene, place, monkeypatch):
    module = extension("gssmc_addon.camera.import_job")
    monkeypatch.setattr(module, "SLICE_S", -1.0)
    room, _, starts = place
    scene.render.resolution_x, scene.render.resolution_y = 111, 555
    before = counts(bpy)
    job = module.CameraImport(scene, starts, room.folder / "photos", True)
    job.start()
    while not job.made:
        job.tick()
        job.join(0.05)
    assert (scene.render.resolution_x, scene.render.resolution_y) != (111, 555)
    job.cancel()
    assert (scene.render.resolution_x, scene.render.resolution_y) == (111, 555)
    assert counts(bpy) == before


# ---- what cannot be refined is grey, and what is wrong is said once


def without_a_splat(bpy, scene):
    scene.gssmc.splat = None


def with_the_splat_deleted(bpy, scene):
    scene.collection.objects.unlink(scene.gssmc.splat)


def without_a_camera(bpy, scene):
    bpy.data.objects.remove(scene.camera)


def without_a_photo(bpy, scene):
    scene.camera.data.gssmc.photo = None
    scene.camera.data.background_images.clear()


@pytest.mark.parametrize("name", ["refine", "preview"])
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without_a_splat, "No splat is picked"),
        (with_the_splat_deleted, "no longer in the scene"),
        (without_a_camera, "no camera for the photo"),
        (without_a_photo, "has no photo"),
    ],
)
def test_a_button_that_can_do_nothing_is_grey_and_says_why(bpy, scene, name, spoil, words):
    button = getattr(bpy.ops.gssmc, name)
    assert button.poll()
    spoil(bpy, scene)
    assert not button.poll()
    with pytest.raises(RuntimeError, match=words):
        button()


def test_the_plates_button_is_grey_without_a_plate(bpy, scene):
    assert not bpy.ops.gssmc.refine_sequence.poll()
    with pytest.raises(RuntimeError, match="no image sequence or movie"):
        bpy.ops.gssmc.refine_sequence()
    scene.gssmc.splat = None
    with pytest.raises(RuntimeError, match="No splat is picked"):
        bpy.ops.gssmc.refine_sequence()


def test_a_script_may_name_a_camera_that_is_not_the_scenes(bpy, scene):
    name, scene.camera = scene.camera.name, None
    assert bpy.ops.gssmc.refine.poll()
    assert bpy.ops.gssmc.refine(camera=name, locate=False) == {"CANCELLED"}
    assert bpy.data.objects[name].data.gssmc.verdict == "FAILED"


@pytest.mark.parametrize("seen", [True, False])
def test_an_error_in_the_window_is_said_once(bpy, extension, context, scene, monkeypatch, seen):
    """In the panel's line where that is seen, and nowhere else; a popup elsewhere."""
    monkeypatch.setattr(extension("gssmc_addon.jobs.operator"), "panel_is_open", lambda _: seen)
    scene.camera.data.type = "ORTHO"
    hand = operator(bpy, extension("operators.refine").GSSMC_OT_refine, splat="", camera="", locate=False)
    assert hand.invoke(context, event()) == {"CANCELLED"}
    assert "Perspective" in bpy.context.window_manager.gssmc.message
    assert len(hand.said) == (0 if seen else 1)
