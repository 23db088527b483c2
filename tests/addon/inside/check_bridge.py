"""The camera bridge, by numbers: where Blender itself draws a point of the splat, against the engine's own projection."""

import itertools

import numpy as np
import pytest
from samples import write_photo

FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
FRAMES = ((1920, 1080, 100), (1080, 1920, 50), (60, 90, 100), (1000, 1000, 33), (601, 899, 100))
ASPECTS = ((1, 1), (1, 1.4), (1.25, 1))
PHOTOS = ((60, 90), (120, 80), (4000, 3000))


def add_camera(bpy, parent=None):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    camera.parent = parent
    return camera


def drawn_at(bpy, camera, points, photo):
    """Photo pixels of scene points by Blender's own matrices: its frame, and a photo fitted into the frame's middle."""
    render, depsgraph = bpy.context.scene.render, bpy.context.evaluated_depsgraph_get()
    size = render.resolution_x, render.resolution_y
    matrix = camera.calc_matrix_camera(
        depsgraph, x=size[0], y=size[1], scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    full = np.array(matrix) @ np.linalg.inv(np.array(camera.matrix_world.normalized()))
    clip = np.c_[points, np.ones(len(points))] @ full.T
    ndc = clip[:, :2] / clip[:, 3:]
    frame = np.stack([(ndc[:, 0] + 1) / 2 * size[0], (1 - ndc[:, 1]) / 2 * size[1]], axis=1)
    scale = min(size[0] / photo[0], size[1] / photo[1])
    return (frame - np.divide(size, 2)) / scale + np.divide(photo, 2)


@pytest.fixture
def splat(bpy, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    splat = bpy.context.scene.gssmc.splat
    splat.location, splat.rotation_euler, splat.scale = (1, -2, 3), (0.4, 0.5, -0.6), (2.5,) * 3
    bpy.context.view_layer.update()
    return splat


def points_before(pose, rng):
    """Points in the splat file's coordinates, 2 to 5 units before the camera."""
    seen = np.c_[rng.uniform(-1, 1, (40, 2)), rng.uniform(2, 5, 40)]
    return (seen - pose.t) @ pose.R


@pytest.mark.parametrize("fit", FITS)
def test_points_lie_where_blender_draws_them(bpy, extension, splat, fit):
    """Reading and writing, over frames, percentages, pixel aspects, shifts, photo shapes and a scaled parent."""
    bridge, scene = extension("gssmc_addon.camera.bridge"), bpy.context.scene
    rng, worst = np.random.default_rng(3), 0.0
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (5, 1, 0), (0.1, 0.2, 0.3), (2, 2, 2)
    for frame, aspect, photo, held in itertools.product(FRAMES, ASPECTS, PHOTOS, (None, parent)):
        camera = add_camera(bpy, held)
        data, render = camera.data, scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = frame
        render.pixel_aspect_x, render.pixel_aspect_y = aspect
        data.sensor_fit, data.sensor_width, data.sensor_height = fit, rng.uniform(10, 40), rng.uniform(10, 40)
        data.lens, data.shift_x, data.shift_y = rng.uniform(15, 90), *rng.uniform(-0.3, 0.3, 2)
        camera.location, camera.rotation_euler = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3)
        bpy.context.view_layer.update()
        for _ in range(2):  # as it was set by hand; then written by us
            found = bridge.read_camera(scene, camera, splat).at_size(*photo)
            points = points_before(found.pose, rng)
            at = found.intrinsics.pinhole().project(found.pose.transform(points))
            shown = (np.c_[points, np.ones(len(points))] @ np.array(splat.matrix_world).T)[:, :3]
            off = np.abs(at - drawn_at(bpy, camera, shown, photo)).max() / max(photo)
            worst = max(worst, off)
            wanted = moved(extension, found, rng)
            bridge.write_camera(scene, camera, splat, wanted)
            bpy.context.view_layer.update()
            back = bridge.read_camera(scene, camera, splat).at_size(*photo)
            np.testing.assert_allclose(back.intrinsics.matrix, wanted.intrinsics.matrix, rtol=2e-5, atol=2e-4)
            distance, degrees = extension("core.geometry.camera").pose_error(back.pose, wanted.pose)
            assert (distance < 1e-4, degrees < 1e-3) == (True, True)
        bpy.data.objects.remove(camera)
    assert worst < 5e-6, "share of the photo's long side by which the two projections differ"


def moved(extension, camera, rng):
    """Another pose, focal length and principal point."""
    engine = extension("core.geometry.camera")
    k, w, h = camera.intrinsics, camera.intrinsics.width, camera.intrinsics.height
    factor = rng.uniform(0.8, 1.3)
    centre = w * rng.uniform(0.45, 0.55), h * rng.uniform(0.45, 0.55)
    lens = engine.Intrinsics(w, h, k.fx * factor, k.fy * factor, *centre, (0.05, -0.01, 0, 0, 0))
    rotation = extension("core.geometry.lie").so3_exp(rng.uniform(-1, 1, 3))
    return engine.Camera(lens, engine.Pose.from_centre(rotation, rng.uniform(-1, 1, 3)))


def test_a_change_of_resolution_leaves_a_written_camera_alone(bpy, extension, splat):
    """Photos of several shapes share one scene; each camera keeps the frame that its lens was written for."""
    bridge, scene = extension("gssmc_addon.camera.bridge"), bpy.context.scene
    camera, rng = add_camera(bpy), np.random.default_rng(1)
    wanted = moved(extension, bridge.read_camera(scene, camera, splat).at_size(60, 90), rng)
    bridge.write_camera(scene, camera, splat, wanted)
    scene.render.resolution_x, scene.render.resolution_y = 500, 900
    got = bridge.read_camera(scene, camera, splat).at_size(60, 90).intrinsics
    np.testing.assert_allclose(got.matrix, wanted.intrinsics.matrix, rtol=1e-5)
    bridge.move_to_render(scene, camera.data, 60, 90)
    got = bridge.read_camera(scene, camera, splat).at_size(60, 90).intrinsics
    np.testing.assert_allclose(got.matrix, wanted.intrinsics.matrix, rtol=1e-5)
    assert (camera.data.gssmc.frame_x, camera.data.gssmc.frame_y) == (500, 900)


def test_an_uneven_parent_is_refused_and_nothing_moves(bpy, extension, splat):
    bridge, scene = extension("gssmc_addon.camera.bridge"), bpy.context.scene
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    parent.scale = (1, 3, 1)
    camera = add_camera(bpy, parent)
    bpy.context.view_layer.update()
    before = [camera.matrix_basis.copy(), camera.data.lens, camera.data.shift_x]
    wanted = moved(extension, bridge.read_camera(scene, camera, splat).at_size(60, 90), np.random.default_rng(0))
    with pytest.raises(extension("core.errors").CameraError, match="scaled unevenly"):
        bridge.write_camera(scene, camera, splat, wanted)
    assert [camera.matrix_basis, camera.data.lens, camera.data.shift_x] == before


@pytest.mark.parametrize("mode", ["XYZ", "QUATERNION", "AXIS_ANGLE"])
def test_an_animated_camera_gets_a_keyframe(bpy, extension, splat, mode):
    bridge, scene = extension("gssmc_addon.camera.bridge"), bpy.context.scene
    channels = extension("gssmc_addon.camera.channels")
    camera = add_camera(bpy)
    camera.rotation_mode = mode
    for frame in (1, 20):
        camera.location.x = frame
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(10)
    channels.check_writable(camera)
    wanted = moved(extension, bridge.read_camera(scene, camera, splat).at_size(60, 90), np.random.default_rng(0))
    bridge.write_camera(scene, camera, splat, wanted)
    assert "keyframe at frame 10" in channels.write_keyframes(scene, camera)
    scene.frame_set(20)
    assert camera.matrix_world.translation.x == pytest.approx(20)
    scene.frame_set(10)
    back = bridge.read_camera(scene, camera, splat).at_size(60, 90)
    distance, degrees = extension("core.geometry.camera").pose_error(back.pose, wanted.pose)
    assert (distance < 1e-4, degrees < 1e-3) == (True, True)


def test_a_still_camera_gets_no_keyframe(bpy, extension):
    camera = add_camera(bpy)
    assert extension("gssmc_addon.camera.channels").write_keyframes(bpy.context.scene, camera) == ""
    assert camera.animation_data is None


def test_an_animated_lens_is_keyed_too(bpy, extension):
    channels, camera = extension("gssmc_addon.camera.channels"), add_camera(bpy)
    camera.data.keyframe_insert("lens", frame=1)
    camera.data.lens = 77
    assert "lens got a keyframe" in channels.write_keyframes(bpy.context.scene, camera)
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    assert camera.data.lens == pytest.approx(77)


def test_a_photo_of_oblong_pixels_is_shown_with_them_in_the_frame_as_it_is(bpy, extension, splat, tmp_path):
    """fx and fy that differ are the photo's own; the render's pixels follow when the user asks for the photo's resolution."""
    bridge, scene = extension("gssmc_addon.camera.bridge"), bpy.context.scene
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="NEW")
    camera, engine = scene.camera, extension("core.geometry.camera")
    lens = engine.Intrinsics(60, 90, 80.0, 100.0, 30.0, 45.0)
    bridge.write_camera(scene, camera, splat, engine.Camera(lens, engine.Pose()))
    image = camera.data.background_images[0].image
    assert tuple(image.display_aspect) == (1.25, 1)
    assert (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y) == (1, 1)
    assert bpy.ops.gssmc.match_resolution() == {"FINISHED"}
    assert (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y) == (1.25, 1)
