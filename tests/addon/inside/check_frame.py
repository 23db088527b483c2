"""Photos of several shapes and pixels in one scene: each camera keeps its own, whatever the render's frame becomes.

What a camera shows is told by Blender's own matrices; where the photo lies, by hand: as large as fits whole, in the middle.
"""

import json

import numpy as np
import pytest
from samples import write_photo

LENSES = {
    "wide.png": (90, 60, 80.0, 80.0, 44.0, 31.0),
    "high.png": (60, 90, 75.0, 75.0, 31.0, 44.0),
    "oblong.png": (60, 40, 50.0, 51.0, 29.0, 21.0),
    "squeezed.png": (60, 90, 80.0, 100.0, 32.0, 44.0),
}
POINTS = np.array([[0.3, 0.1, 2.0], [-0.2, 0.4, 3.0], [0.1, -0.5, 2.5], [-0.4, -0.3, 4.0]])  # before the camera, y down


@pytest.fixture
def scene(bpy, tmp_path, splat_file):
    """A splat, and for each of LENSES a photo with that lens by a camera file, at the splat's origin."""
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    frames = []
    for name, (width, height, fx, fy, cx, cy) in LENSES.items():
        write_photo(tmp_path / name, width, height)
        pose = {"R": np.eye(3).tolist(), "t": [0, 0, 0]}
        frames.append({"file": name, "width": width, "height": height, "fx": fx, "fy": fy, "cx": cx, "cy": cy, **pose})
    (tmp_path / "cameras.json").write_text(json.dumps({"frames": frames}))
    for name in LENSES:
        bpy.ops.gssmc.add_photo(filepath=str(tmp_path / name), camera="NEW", camera_file=str(tmp_path / "cameras.json"))
    return bpy.context.scene


def cameras(scene):
    return {f"{obj.name}.png": obj for obj in scene.objects if obj.type == "CAMERA"}


def shown_in_photo(bpy, camera):
    """Photo pixels at which Blender shows POINTS: its frame's, then those of a photo that is fitted into the frame."""
    render, depsgraph = bpy.context.scene.render, bpy.context.evaluated_depsgraph_get()
    size, aspect = np.array([render.resolution_x, render.resolution_y]), [render.pixel_aspect_x, render.pixel_aspect_y]
    matrix = camera.calc_matrix_camera(depsgraph, x=int(size[0]), y=int(size[1]), scale_x=aspect[0], scale_y=aspect[1])
    clip = np.c_[POINTS * (1, -1, -1), np.ones(len(POINTS))] @ np.array(matrix).T
    from_middle = clip[:, :2] / clip[:, 3:] * (1, -1) / 2 * size * aspect
    image = camera.data.background_images[0].image
    pixel = np.array(image.display_aspect)
    photo = np.array(LENSES[f"{camera.name}.png"][:2])
    scale = (size * aspect / (photo * pixel)).min()
    return from_middle / scale / pixel + photo / 2


def by_hand(name):
    fx, fy, cx, cy = LENSES[name][2:]
    return POINTS[:, :2] / POINTS[:, 2:] * (fx, fy) + (cx, cy)


def assert_all_fit(bpy, extension, scene):
    """Each as Blender draws it, and as the engine reads it."""
    bridge = extension("gssmc_addon.camera.bridge")
    for name, camera in cameras(scene).items():
        width, height, fx, fy, cx, cy = LENSES[name]
        np.testing.assert_allclose(shown_in_photo(bpy, camera), by_hand(name), atol=2e-3, err_msg=name)
        read = bridge.read_camera(scene, camera, scene.gssmc.splat).at_size(width, height).intrinsics
        np.testing.assert_allclose((read.fx, read.fy, read.cx, read.cy), (fx, fy, cx, cy), rtol=1e-5, err_msg=name)


def test_photos_with_different_pixels_live_side_by_side(bpy, extension, scene):
    assert_all_fit(bpy, extension, scene)
    assert (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y) == (1, 1)
    aspects = {name: tuple(camera.data.background_images[0].image.display_aspect) for name, camera in cameras(scene).items()}
    assert aspects["squeezed.png"] == pytest.approx((1.25, 1))
    assert aspects["wide.png"] == (1, 1)


def test_one_photo_behind_two_cameras_is_shown_with_the_pixels_of_the_one_in_use(bpy, scene):
    one, other = (cameras(scene)[name] for name in ("wide.png", "squeezed.png"))
    one.data.gssmc.photo = other.data.gssmc.photo
    for camera, aspect in ((one, (1, 1)), (other, (1.25, 1)), (one, (1, 1))):
        scene.camera = camera
        bpy.context.view_layer.update()
        assert tuple(other.data.gssmc.photo.display_aspect) == pytest.approx(aspect)


@pytest.mark.parametrize("name", LENSES)
def test_matching_the_resolution_leaves_every_camera_its_fit(bpy, extension, scene, name):
    scene.camera = cameras(scene)[name]
    assert bpy.ops.gssmc.match_resolution() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert (scene.render.resolution_x, scene.render.resolution_y) == LENSES[name][:2]
    assert scene.render.pixel_aspect_x / scene.render.pixel_aspect_y == pytest.approx(LENSES[name][3] / LENSES[name][2])
    assert_all_fit(bpy, extension, scene)


@pytest.mark.parametrize("shape", [(1080, 1920, 1, 1), (500, 500, 1, 1.4), (640, 200, 2, 1)])
def test_every_camera_follows_when_the_resolution_is_changed_by_hand(bpy, extension, scene, shape):
    render = scene.render
    render.resolution_x, render.resolution_y, render.pixel_aspect_x, render.pixel_aspect_y = shape
    bpy.context.view_layer.update()
    assert_all_fit(bpy, extension, scene)


def test_a_camera_is_fitted_when_it_becomes_the_scenes(bpy, extension, scene):
    """None of the photos' cameras was the scene's when the resolution changed."""
    own = bpy.data.objects.new("own", bpy.data.cameras.new("own"))
    scene.collection.objects.link(own)
    scene.camera = own
    bpy.context.view_layer.update()
    scene.render.resolution_x, scene.render.resolution_y = 700, 900
    bpy.context.view_layer.update()
    assert own.data.lens == 50
    for name in ("high.png", "wide.png"):
        scene.gssmc.photo_index = list(LENSES).index(name)
        np.testing.assert_allclose(shown_in_photo(bpy, scene.camera), by_hand(name), atol=2e-3)


def test_a_render_is_fitted_before_it_is_drawn(bpy, extension, scene):
    """A script that sets the resolution and renders at once, with markers that change the camera meanwhile."""
    scene.camera = None
    bpy.context.view_layer.update()
    scene.render.engine, scene.cycles.samples, scene.render.resolution_percentage = "CYCLES", 1, 1
    scene.render.resolution_x, scene.render.resolution_y = 500, 1500
    scene.camera = cameras(scene)["wide.png"]
    bpy.ops.render.render()
    assert_all_fit(bpy, extension, scene)


def test_keyframes_of_a_lens_follow_and_a_driven_lens_is_left_alone(bpy, extension, scene):
    keyed, driven = (cameras(scene)[name] for name in ("wide.png", "high.png"))
    keyed.data.keyframe_insert("lens", frame=1)
    keyed.data.keyframe_insert("shift_x", frame=1)
    driven.data.driver_add("lens").driver.expression = repr(driven.data.lens)
    lens = driven.data.lens
    scene.render.resolution_x, scene.render.resolution_y = 900, 1000
    bpy.context.view_layer.update()
    scene.frame_set(20)
    scene.frame_set(1)
    np.testing.assert_allclose(shown_in_photo(bpy, keyed), by_hand("wide.png"), atol=2e-3)
    assert driven.data.lens == lens
    read = extension("gssmc_addon.camera.bridge").read_camera(scene, driven, scene.gssmc.splat).at_size(60, 90)
    assert read.intrinsics.fx == pytest.approx(75, rel=1e-5), "the engine knows the frame that it was set for"


def test_two_scenes_with_one_camera_do_not_take_it_from_each_other(bpy, scene):
    other = bpy.data.scenes.new("other")
    camera = scene.camera
    other.collection.objects.link(camera)
    other.camera, other.render.resolution_x, other.render.resolution_y = camera, 100, 700
    lens = camera.data.lens
    for each in (scene, other):
        each.view_layers[0].update()
    assert camera.data.lens == lens
    assert camera.data.gssmc.frame_x == 1920


def test_undo_and_a_saved_file_keep_the_fit(bpy, extension, scene, tmp_path):
    bpy.ops.ed.undo_push(message="before")
    scene.camera = cameras(scene)["high.png"]
    bpy.ops.gssmc.match_resolution()
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    assert scene.render.resolution_x == 1920
    assert_all_fit(bpy, extension, scene)
    scene.render.resolution_x = 300
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    assert_all_fit(bpy, extension, scene)


def test_a_file_of_an_older_version_reads_as_it_did(bpy, extension, scene):
    """It kept the frame's resolution alone; its photos had the pixels of the render."""
    scene.camera = camera = cameras(scene)["squeezed.png"]
    bpy.ops.gssmc.match_resolution()
    for name in ("frame_pixel", "photo_pixel", "photo_x", "photo_y", "framed"):
        camera.data.gssmc.property_unset(name)
    read = extension("gssmc_addon.camera.bridge").read_camera(scene, camera, scene.gssmc.splat).at_size(60, 90).intrinsics
    np.testing.assert_allclose((read.fx, read.fy, read.cx, read.cy), LENSES["squeezed.png"][2:], rtol=1e-5)
    scene.render.resolution_x = 200
    bpy.context.view_layer.update()
    np.testing.assert_allclose(shown_in_photo(bpy, camera), by_hand("squeezed.png"), atol=2e-3)


def test_a_camera_from_the_view_behaves_as_blenders_own(bpy, extension):
    view = extension("gssmc_addon.photo.camera").find_view(bpy.context)
    if view is None:
        pytest.skip("this Blender has no viewport in background mode")
    view.region.view_perspective = "PERSP"
    assert bpy.ops.gssmc.camera_from_view(new=True) == {"FINISHED"}
    scene = bpy.context.scene
    lens = scene.camera.data.lens
    scene.render.resolution_x, scene.render.resolution_y = 300, 900
    bpy.context.view_layer.update()
    assert scene.camera.data.lens == lens
