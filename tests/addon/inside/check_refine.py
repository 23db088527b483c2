"""Refine Camera: what it refuses, what it leaves alone, and what may happen to the scene while it runs."""

import sys

import numpy as np
import pytest
from samples import counts

MODULE = "bl_ext.user_default.gssmc"


def state(scene):
    camera = scene.camera
    return [x for row in camera.matrix_world for x in row], camera.data.lens, camera.data.shift_x, camera.data.shift_y


def refused(bpy, words):
    """Refine must end in one sentence that holds `words`, and change nothing."""
    before = counts(bpy)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.refine()
    message = str(error.value).strip()
    assert words in message
    assert "Traceback" not in message
    assert "\n" not in message
    assert bpy.context.window_manager.gssmc.message in message
    assert counts(bpy) == before


def test_a_photo_of_another_place_fails_and_moves_nothing(bpy, scene):
    before = state(scene)
    assert bpy.ops.gssmc.refine(locate=False) == {"CANCELLED"}
    assert scene.camera.data.gssmc.verdict == "FAILED"
    assert scene.camera.data.gssmc.reasons
    assert state(scene) == before


def test_blender_waits_little_for_the_interpreter_while_the_work_runs_and_no_more_after(bpy, scene, extension, monkeypatch):
    module, before, seen = extension("gssmc_addon.jobs.worker"), sys.getswitchinterval(), []
    work = module.refinement

    def watched(inputs):
        seen.append(sys.getswitchinterval())
        return (yield from work(inputs))

    monkeypatch.setattr(extension("gssmc_addon.refine.job"), "refinement", watched)
    bpy.ops.gssmc.refine(locate=False)
    assert seen[0] < 0.001 < before
    assert sys.getswitchinterval() == before


def test_a_start_that_looks_away_fails_or_is_refused(bpy, scene):
    scene.camera.rotation_euler = (np.pi, 0, 0)
    bpy.context.view_layer.update()
    before = state(scene)
    try:
        assert bpy.ops.gssmc.refine(locate=False) == {"CANCELLED"}
        assert scene.camera.data.gssmc.verdict == "FAILED"
    except RuntimeError as error:
        assert "Traceback" not in str(error)
    assert state(scene) == before


def test_without_a_splat(bpy, scene):
    scene.gssmc.splat = None
    refused(bpy, "No splat")


def test_without_a_camera(bpy, scene):
    bpy.data.objects.remove(scene.camera)
    refused(bpy, "no camera")


def test_without_a_photo(bpy, scene):
    scene.camera.data.gssmc.photo = None
    scene.camera.data.background_images.clear()
    refused(bpy, "no photo")


def test_with_a_splat_deleted_by_the_user(bpy, scene):
    """The panel's pick keeps the object alive in the file, though the user has deleted it from the scene."""
    with bpy.context.temp_override(selected_objects=[scene.gssmc.splat]):
        bpy.ops.object.delete()
    refused(bpy, "no longer in the scene")


def test_with_the_photo_file_gone(bpy, scene, tmp_path):
    (tmp_path / "a.png").unlink()
    refused(bpy, "a.png")


def test_with_a_packed_photo_the_file_is_not_needed(bpy, scene, tmp_path):
    scene.camera.data.gssmc.photo.pack()
    (tmp_path / "a.png").unlink()
    bpy.ops.gssmc.refine(locate=False)
    assert scene.camera.data.gssmc.verdict == "FAILED"


@pytest.mark.parametrize(("scale", "words"), [((1, 1, 2), "unevenly"), ((-1, 1, 1), "mirrored"), ((0, 1, 1), "of zero")])
def test_with_a_splat_that_is_not_evenly_scaled(bpy, scene, scale, words):
    scene.gssmc.splat.scale = scale
    refused(bpy, words)


def test_with_an_orthographic_camera(bpy, scene):
    scene.camera.data.type = "ORTHO"
    refused(bpy, "Perspective")


def test_with_a_constraint_that_holds_the_camera(bpy, scene):
    scene.camera.constraints.new("TRACK_TO").target = scene.gssmc.splat
    refused(bpy, "Track To")


def test_with_a_driven_camera(bpy, scene):
    scene.camera.driver_add("location", 0)
    refused(bpy, "driven")


def test_with_an_nla_track(bpy, scene):
    scene.camera.keyframe_insert("location")
    animation = scene.camera.animation_data
    action, animation.action = animation.action, None
    animation.nla_tracks.new().strips.new("strip", 1, action)
    refused(bpy, "NLA")


def test_with_a_sheared_camera(bpy, scene):
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    parent.scale = (1, 3, 1)
    scene.camera.parent = parent
    scene.camera.rotation_euler = (0.3, 0.4, 0.5)
    refused(bpy, "sheared")


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "QUATERNION", "AXIS_ANGLE"])
@pytest.mark.parametrize("parented", [False, True])
def test_a_result_lands_where_it_should(bpy, scene, extension, mode, parented):
    """Write and read back through Blender, for every rotation mode, with a moved splat and a scaled parent."""
    bridge, cam = extension("gssmc_addon.camera.bridge"), extension("core.geometry.camera")
    splat, camera = scene.gssmc.splat, scene.camera
    splat.location, splat.rotation_euler, splat.scale = (1, -2, 3), (0.4, 0.5, -0.6), (2.5,) * 3
    camera.rotation_mode = mode
    if parented:
        parent = bpy.data.objects.new("parent", None)
        scene.collection.objects.link(parent)
        parent.location, parent.rotation_euler, parent.scale = (5, 1, 0), (0.1, 0.2, 0.3), (2, 2, 2)
        camera.parent = parent
    bpy.context.view_layer.update()
    angle = 0.7
    r = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    wanted = cam.Camera(cam.Intrinsics(60, 90, 70.0, 70.0, 33.0, 41.0), cam.Pose(r, (0.1, 0.2, 3.0)))
    bridge.write_camera(scene, camera, splat, wanted)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(camera.matrix_world.to_scale(), (1, 1, 1), atol=1e-5)
    got = bridge.read_camera(scene, camera, splat).at_size(60, 90)
    distance, degrees = cam.pose_error(got.pose, wanted.pose)
    assert distance < 1e-5
    assert degrees < 1e-4
    np.testing.assert_allclose(got.intrinsics.matrix, wanted.intrinsics.matrix, rtol=1e-5)


@pytest.fixture
def job(bpy, scene, extension):
    """A running job, driven by hand as the timer of the window does it."""
    settings = extension("core.pose.settings").RefineSettings()
    job = extension("gssmc_addon.refine.job").prepare(scene, scene.gssmc.splat, scene.camera, settings)
    job.start()
    yield job
    job.cancel()
    assert job.join(60)


@pytest.mark.parametrize("what", ["splat", "camera", "photo"])
def test_what_is_deleted_while_the_job_runs_ends_it(bpy, scene, job, extension, what):
    blocks = {"splat": (bpy.data.objects, scene.gssmc.splat), "camera": (bpy.data.objects, scene.camera)}
    blocks["photo"] = (bpy.data.images, scene.camera.data.gssmc.photo)
    collection, block = blocks[what]
    collection.remove(block)
    with pytest.raises(extension("core.errors").RefineError, match=what):
        job.tick()
    assert job.cancelled


def test_a_job_survives_a_rename_and_a_move(bpy, scene, job):
    scene.gssmc.splat.name, scene.camera.name = "new splat", "new camera"
    scene.gssmc.splat.location.x += 1
    job.tick()
    assert not job.cancelled


def test_a_result_is_not_applied_to_a_splat_scaled_unevenly_meanwhile(bpy, scene, job, extension):
    report = extension("core.pose.report")
    camera = job.inputs.camera.at_size(60, 90)
    scene.gssmc.splat.scale = (1, 2, 1)
    bpy.context.view_layer.update()
    before = state(scene)
    end = report.RefineReport(camera, camera, "trusted", ("It fits.",), (), 1.0)
    with pytest.raises(extension("core.errors").GssmcError, match="unevenly"):
        extension("gssmc_addon.refine.job").apply_report(job.targets, end)
    assert state(scene) == before
    assert scene.camera.data.gssmc.verdict == "NONE"


def test_switching_the_extension_off_ends_its_thread(bpy, scene, extension):
    import addon_utils

    jobs, slot = extension("gssmc_addon.refine.job"), extension("gssmc_addon.jobs.slot")
    settings = extension("core.pose.settings").RefineSettings()
    job = jobs.prepare(scene, scene.gssmc.splat, scene.camera, settings)
    slot.begin(bpy.context, job)
    assert slot.active() is job
    addon_utils.disable(MODULE)
    assert job.cancelled
    assert job.join(60)
    assert addon_utils.enable(MODULE) is not None
    assert slot.active() is None


def test_opening_a_file_ends_the_job(bpy, scene, extension, tmp_path):
    jobs, slot = extension("gssmc_addon.refine.job"), extension("gssmc_addon.jobs.slot")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    settings = extension("core.pose.settings").RefineSettings()
    job = jobs.prepare(scene, scene.gssmc.splat, scene.camera, settings)
    slot.begin(bpy.context, job)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert job.cancelled
    assert slot.active() is None
    assert bpy.ops.gssmc.refine(locate=False) == {"CANCELLED"}
    assert bpy.context.scene.camera.data.gssmc.verdict == "FAILED"


# ---- the splat's copy, made in steps beside the user's own work


@pytest.fixture
def copying(scene, extension):
    """A copy that has begun, of a splat with a value that is not finite, as editing tools leave it."""
    scene.gssmc.splat.data.attributes["scale"].data[3].vector = (np.nan, 1, 1)
    copying = extension("gssmc_addon.splat.copy").SplatCopying(scene.gssmc.splat)
    copying.start()
    yield copying
    copying.stop()


def advance(copying, fraction=1.0):
    """One attribute per call, since each call comes too late; the calls that it took to get to `fraction`."""
    calls, before = 0, copying.fraction
    while copying.fraction < fraction:
        copying.advance(0.0)
        calls += copying.fraction > before
        before = copying.fraction
    return calls


def test_a_copy_in_steps_is_the_copy_at_once(scene, extension, copying):
    wanted = extension("gssmc_addon.splat.copy").SplatCopying(scene.gssmc.splat).finish().copy()
    assert advance(copying) == 2 * (4 + len(wanted.bands)), "every attribute in a call of its own, read and compared"
    assert copying.advance(0.0)
    got = copying.copy()
    for name in ("means", "scales", "rotations", "base"):
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name))
    np.testing.assert_array_equal(got.bands, wanted.bands)
    assert got.assemble().dropped == 1


def test_a_copy_is_checked_as_a_file_is(scene, extension):
    """Editing tools leave quaternions of any length and scales below zero; neither may reach the renderer."""
    attributes = scene.gssmc.splat.data.attributes
    attributes["rotation"].data[4].value = (0, 3, 0, 0)
    attributes["scale"].data[6].vector = (0.1, -0.1, 0.1)
    got = extension("gssmc_addon.splat.copy").read_splat(scene.gssmc.splat)
    assert (got.dropped, got.normalised) == (1, 1)
    np.testing.assert_allclose(np.linalg.norm(got.rotations, axis=1), 1, atol=1e-4)
    np.testing.assert_allclose(got.rotations[4], (0, 1, 0, 0), atol=1e-6)


def paint_a_point(bpy, splat):
    """What is copied first, and what is compared last."""
    for name in ("position", "radiance:sh_2"):
        splat.data.attributes[name].data[5].vector = (9, 9, 9)


def lose_an_attribute(bpy, splat):
    splat.data.attributes.remove(splat.data.attributes["radiance:sh_0"])


def add_points(bpy, splat):
    if not hasattr(splat.data, "resize"):
        pytest.skip("this Blender cannot resize a point cloud")
    splat.data.resize(300)


def change_the_data(bpy, splat):
    splat.data = splat.data.copy()


def delete(bpy, splat):
    bpy.data.objects.remove(splat)


EDITS = ((paint_a_point, "edited"), (lose_an_attribute, "edited"), (add_points, "edited"), (change_the_data, "edited"))


@pytest.mark.parametrize("copied", [0.2, 0.5, 0.52])
@pytest.mark.parametrize(("edit", "words"), [*EDITS, (delete, "removed")])
def test_what_is_edited_while_it_is_copied_is_refused(bpy, scene, extension, copying, edit, words, copied):
    advance(copying, copied)
    edit(bpy, scene.gssmc.splat)
    with pytest.raises(extension("core.errors").SplatFormatError, match=f'"scan" was {words} while it was copied'):
        advance(copying)


def test_a_job_whose_splat_is_edited_while_it_is_copied_changes_nothing(bpy, scene, job, extension, monkeypatch):
    monkeypatch.setattr(extension("gssmc_addon.jobs.machine"), "COPY_S", -1.0)  # one attribute per tick, as in a large scan
    before = counts(bpy), state(scene)
    job.tick()
    assert job.step == "Copying the splat"
    paint_a_point(bpy, scene.gssmc.splat)
    scene.gssmc.splat.data.attributes.remove(scene.gssmc.splat.data.attributes["rotation"])
    with pytest.raises(extension("core.errors").GssmcError, match="edited"):
        while True:
            job.tick()
    assert job.cancelled
    assert (counts(bpy), state(scene)) == before


def test_a_job_can_be_stopped_while_its_splat_is_copied(scene, job):
    job.cancel()
    assert job.join(0), "no thread of the refinement runs yet"
    assert scene.camera.data.gssmc.verdict == "NONE"
