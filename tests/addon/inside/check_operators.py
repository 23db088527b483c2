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


def test_a_proxy_is_made(bpy, scene):
    assert bpy.ops.gssmc.make_proxy(use="HOLDOUT", faces=300, long_side_px=96) == {"FINISHED"}
    proxy = scene.objects["scan Proxy"]
    assert proxy.is_holdout and proxy.gssmc.proxy_of == scene.gssmc.splat and 0 < len(proxy.data.polygons) <= 300


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


def refusal(bpy):
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.gssmc.set_up_composite()
    return str(caught.value)


def test_a_composite_needs_a_camera_and_a_photo_and_says_where_nothing_was_solved(bpy, extension, scene):
    before = shots.everything(bpy, scene)
    assert bpy.ops.gssmc.set_up_composite() == {"FINISHED"}
    assert "was not solved here" in bpy.context.window_manager.gssmc.message
    assert bpy.ops.gssmc.remove_composite() == {"FINISHED"}
    if bpy.app.version >= (5, 0):  # Blender 4.5 keeps the two nodes that it made itself, switched off.
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


def test_splat_and_cg_hide_each_other(bpy, scene, tmp_path):
    """Two balls, in front of a wall of Gaussians and behind it, where the wall ends in the middle of the picture."""
    for obj in [scene.gssmc.splat, scene.camera]:
        bpy.data.objects.remove(obj)
    bpy.ops.gssmc.import_splats(filepath=str(shots.write_wall(tmp_path / "wall.ply")), orientation="Z_UP")
    splat = scene.gssmc.splat
    splat.scale = (2, 2, 2)  # its depths are in other units than the scene's
    camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    scene.collection.objects.link(camera)
    scene.camera, camera.rotation_euler = camera, (np.pi, 0, 0)  # along z, with y down
    camera.keyframe_insert("location", frame=1)
    camera.location.x = 0.02
    camera.keyframe_insert("location", frame=3)
    red, blue = (shots.material(bpy, "Emission", color) for color in ((1, 0, 0), (0, 0, 1)))
    shots.add_ball(bpy, scene, (0, -0.4, 2), 0.35, red, 12)
    shots.add_ball(bpy, scene, (0, 0.6, 4), 0.5, blue, 12)
    scene.render.engine, scene.view_settings.view_transform = "CYCLES", "Standard"
    scene.render.resolution_x, scene.render.resolution_y, scene.frame_end = 60, 40, 3
    scene.frame_set(1)
    with pytest.raises(RuntimeError, match="Render Splat first"):
        bpy.ops.gssmc.set_up_composite(behind="SPLAT")
    assert bpy.ops.gssmc.render_splat(folder=str(tmp_path / "frames")) == {"FINISHED"}
    frames = [tmp_path / "frames" / f"splat_{number:04d}.exr" for number in (1, 2, 3)]
    made = [frame.stat().st_mtime_ns for frame in frames]
    frames[1].unlink()
    frames[2].write_bytes(frames[2].read_bytes()[:200])  # as a full disk leaves it
    assert bpy.ops.gssmc.render_splat(folder=str(tmp_path / "frames")) == {"FINISHED"}
    assert [frame.stat().st_mtime_ns == then for frame, then in zip(frames, made, strict=True)] == [True, False, False]
    assert min(frame.stat().st_size for frame in frames) > 200
    with pytest.raises(RuntimeError, match="No folder is given"):
        bpy.ops.gssmc.render_splat(folder="")
    if bpy.app.version < (5, 0):
        scene.use_nodes = True  # Blender makes its usual nodes, which would count as a change.
        scene.use_nodes = False
    before = shots.everything(bpy, scene)
    assert bpy.ops.gssmc.set_up_composite(behind="SPLAT") == {"FINISHED"}
    got = shots.render(bpy, scene, tmp_path / "f12.png", 8)
    focal, middle = 50 / 36 * 60, np.array([30, 20])
    front, back = (np.round(middle + focal * np.array(at) / z).astype(int) for at, z in (((0, -0.4), 2), ((0, 0.6), 4)))
    for offset in (-6, 6):  # in front of the wall, and where it ends
        np.testing.assert_allclose(got[front[1], front[0] + offset], (255, 0, 0), atol=3)
    np.testing.assert_allclose(got[back[1], back[0] + 5], (0, 0, 255), atol=3)
    np.testing.assert_allclose(got[back[1], back[0] - 5], (128, 128, 128), atol=6)  # behind it
    np.testing.assert_allclose(got[20, 3], (128, 128, 128), atol=6)  # the wall, in the colour that it was trained with
    assert got[20, 55].max() == 0
    bpy.ops.gssmc.remove_composite()
    scene.render.filepath = before["render"]["filepath"]
    after = shots.everything(bpy, scene)
    assert {key for key in before | after if before.get(key) != after.get(key)} == set()
    assert bpy.ops.gssmc.render_splat(folder=str(tmp_path / "frames"), start=2, end=2) == {"FINISHED"}
    bpy.ops.gssmc.set_up_composite(behind="SPLAT")
    scene.frame_set(9)  # One frame alone shows at all times.
    np.testing.assert_allclose(shots.render(bpy, scene, tmp_path / "still.png", 1)[20, 3], (128, 128, 128), atol=6)


def test_what_the_longest_checks_alone_would_call(bpy, scene, tmp_path):
    """They run in one Blender; these calls are short enough for each."""
    assert bpy.ops.gssmc.clear_maps() == {"FINISHED"}
    assert bpy.ops.gssmc.preview(long_side_px=64, background=False) == {"FINISHED"}
    file, _ = (write_photo(tmp_path / f"shot.{number:04d}.png") for number in (1001, 1002))
    assert bpy.ops.gssmc.add_plate(filepath=str(file)) == {"FINISHED"}
    assert (scene.camera.name, scene.frame_start, scene.frame_end) == ("shot", 1001, 1002)
    for entry in scene.gssmc.photos:
        entry.ticked = False
    with pytest.raises(RuntimeError):
        bpy.ops.gssmc.find_all(which="TICKED")
