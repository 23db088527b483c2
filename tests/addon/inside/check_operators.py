"""Every operator is driven in every Blender that the tests install the zip into; here those that no other check calls."""

import ast

import cv2
import numpy as np
import plan
import pytest
import shots
from samples import write_photo


def called(blender):
    """Names of the operators that the checks of a Blender call; asking their poll is no call."""
    tree = [node for path in plan.checks(blender) for node in ast.walk(ast.parse(path.read_text()))]
    functions = [n.func for n in tree if isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute)]
    return {f.attr for f in functions if ast.unparse(f.value) == "bpy.ops.gssmc"}


def test_every_registered_operator_is_driven(bpy):
    registered = {name for name in dir(bpy.ops.gssmc) if not name.startswith("_")}
    assert len(registered) >= 19
    assert registered - called(bpy.app.version[:2]) == set()


def test_cancel_stops_the_running_job(bpy, extension, scene):
    jobs, slot = extension("gssmc_addon.refine.job"), extension("gssmc_addon.jobs.slot")
    settings = extension("core.pose.settings").RefineSettings()
    job = jobs.prepare(scene, scene.gssmc.splat, scene.camera, settings)
    assert not bpy.ops.gssmc.cancel.poll()
    slot.begin(bpy.context, job)  # as the button does; the timer that would drive it is the window's
    try:
        assert not bpy.ops.gssmc.refine.poll()
        assert bpy.ops.gssmc.cancel() == {"FINISHED"}
        assert job.cancelled
        assert job.join(60)
    finally:
        slot.end(job)
    assert bpy.ops.gssmc.refine.poll()


def complaint(bpy):
    """The line that a refinement which cannot begin leaves in the panel."""
    with pytest.raises(RuntimeError):
        bpy.ops.gssmc.refine()
    own = bpy.context.window_manager.gssmc
    assert own.message_icon == "ERROR"
    return own.message


def test_an_import_clears_what_was_wrong_before(bpy, splat_file):
    with pytest.raises(RuntimeError):
        bpy.ops.gssmc.import_splats(filepath=str(splat_file.with_name("none.ply")))
    assert "none.ply" in bpy.context.window_manager.gssmc.message
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    assert bpy.context.window_manager.gssmc.message == ""


def test_a_splat_or_a_photo_picked_by_hand_clears_what_was_wrong_with_the_one_before(bpy, scene):
    splat, data = scene.gssmc.splat, scene.camera.data
    splat.scale = (1, 1, 2)
    assert "unevenly" in complaint(bpy)
    scene.gssmc.splat = splat
    assert bpy.context.window_manager.gssmc.message == ""
    assert "unevenly" in complaint(bpy)
    data.gssmc.photo = data.gssmc.photo
    assert bpy.context.window_manager.gssmc.message == ""


def success(bpy, scene, tmp_path, name):
    """One operator of each kind, called so that it does its work."""
    if name == "add_photos":
        return bpy.ops.gssmc.add_photos(filepath=str(write_photo(tmp_path / "b.png")))
    if name == "set_mask":
        return bpy.ops.gssmc.set_mask(filepath=str(write_photo(tmp_path / "mask.png")))
    if name == "export_cameras":
        return bpy.ops.gssmc.export_cameras(filepath=str(tmp_path / "cameras.json"))
    return getattr(bpy.ops.gssmc, name)()


@pytest.mark.parametrize("name", ["add_photos", "set_mask", "export_cameras", "match_resolution", "remove_photo"])
def test_every_success_clears_the_panels_line(bpy, scene, tmp_path, name):
    scene.camera.data.type = "PANO"
    assert complaint(bpy)
    scene.camera.data.type = "PERSP"
    assert success(bpy, scene, tmp_path, name) == {"FINISHED"}
    assert bpy.context.window_manager.gssmc.message == ""


def refusal(bpy):
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.gssmc.set_up_composite()
    return str(caught.value)


def test_a_composite_needs_a_camera_a_photo_and_a_solution(bpy, extension, scene):
    before = shots.everything(bpy, scene)
    assert "not solved yet" in refusal(bpy)
    assert shots.everything(bpy, scene) == before
    camera, photo = scene.camera, scene.camera.data.gssmc.photo
    camera.data.gssmc.photo = None
    camera.data.background_images.clear()
    assert "has no photo" in refusal(bpy)
    camera.data.gssmc.photo, scene.camera = photo, None
    assert "no camera" in refusal(bpy)
    assert not bpy.ops.gssmc.remove_composite.poll()


@pytest.mark.parametrize("own", [True, False])
def test_a_composite_shows_the_photo_and_leaves_no_trace(bpy, extension, scene, tmp_path, own):
    """In a scene with a compositor, a keyed lens, another camera and backgrounds of its own."""
    camera = scene.camera
    camera.data.gssmc.k1 = -0.12
    camera.data.background_images[0].offset = (0.0, 0.0)
    shots.solved(bpy, extension, scene)
    camera.data.keyframe_insert("lens", frame=1)
    other = bpy.data.objects.new("other", bpy.data.cameras.new("other"))
    scene.collection.objects.link(other)
    tree = shots.own_compositor(bpy, scene) if own else None
    if own:
        scene.view_settings.exposure, scene.render.resolution_percentage = 0.7, 50
    elif bpy.app.version < (5, 0):
        scene.use_nodes = True  # Blender makes its usual nodes, which would count as a change.
        scene.use_nodes = False
    scene.render.engine = "CYCLES"
    bpy.context.view_layer.update()
    before = shots.everything(bpy, scene)
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    assert "Make Proxy" in bpy.context.window_manager.gssmc.message
    assert (scene.render.resolution_x, scene.render.resolution_y) == (60, 90)
    assert camera.data.gssmc.overscan > 1
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}  # once more, and still one way back
    picture = shots.render(bpy, scene, tmp_path / "f12.png", 1)
    photo = cv2.imread(str(tmp_path / "a.png"))[..., ::-1].astype(int)
    assert np.abs(picture - photo).max() <= 1
    image = scene.render.filepath, scene.render.image_settings.file_format
    assert bpy.ops.gssmc.remove_composite() == {"FINISHED"}
    scene.render.filepath = before["render"]["filepath"]
    assert image[1] == "PNG"
    after = shots.everything(bpy, scene)
    assert {key: (before.get(key), after.get(key)) for key in before | after if before.get(key) != after.get(key)} == {}
    if own and bpy.app.version >= (5, 0):
        assert tree.name in bpy.data.node_groups
