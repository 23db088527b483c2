"""Every operator is driven in every Blender that the tests install the zip into; here those that no other check calls."""

import ast

import plan
import pytest
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


def test_pins_floor_and_scale_work(bpy, scene):
    """check_pins says what they do, in one Blender."""
    for x, y, z in ((-1, -1, 0), (1, -1, 1), (0, 1, 0.5)):
        assert bpy.ops.gssmc.add_pin(photo_x=30 + 9 * x, photo_y=45 - 9 * y, world=(x, y, z)) == {"FINISHED"}
    assert bpy.ops.gssmc.solve_pins() == {"FINISHED"}
    assert bpy.ops.gssmc.place_by_pins() == {"FINISHED"}
    assert scene.camera.data.gssmc.verdict == "PINNED"
    assert bpy.ops.gssmc.remove_pin() == {"FINISHED"}
    assert bpy.ops.gssmc.set_floor(method="POINTS", points=(0, 0, 1, 1, 0, 1, 0, 1, 1)) == {"FINISHED"}
    assert bpy.ops.gssmc.set_scale(points=(0, 0, 0, 1, 0, 0), distance=2.0) == {"FINISHED"}
    assert tuple(scene.gssmc.splat.matrix_world.to_scale()) == pytest.approx((2, 2, 2))


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
