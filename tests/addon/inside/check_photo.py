"""Add Photo: camera, background, lens and frame."""

import json
import struct

import numpy as np
import pytest
from samples import counts, write_photo

DIAGONAL_35MM = np.hypot(36, 24)


def focal_px(camera, width, height):
    """Focal length along the long side, by Blender's definition: lens over sensor width in AUTO fit."""
    assert camera.data.sensor_fit == "AUTO"
    return camera.data.lens / camera.data.sensor_width * max(width, height)


def test_makes_a_camera_with_the_photo_behind_it(bpy, tmp_path):
    photo = write_photo(tmp_path / "a.jpg", 60, 90, focal_35mm=28)
    assert bpy.ops.gssmc.add_photo(filepath=str(photo), set_resolution=True) == {"FINISHED"}
    camera = bpy.context.scene.camera
    (background,) = camera.data.background_images
    assert camera.data.show_background_images
    assert tuple(background.image.size) == (60, 90)
    assert camera.data.gssmc.photo == background.image
    assert focal_px(camera, 60, 90) == pytest.approx(28 * np.hypot(60, 90) / DIAGONAL_35MM, rel=1e-5)
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y) == (60, 90)


def test_a_photo_without_exif_keeps_the_lens(bpy, tmp_path):
    camera = add_camera(bpy)
    camera.data.lens = 41.0
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")), camera="SCENE")
    assert bpy.context.scene.camera == camera
    assert camera.data.lens == pytest.approx(41.0)


def test_takes_the_scene_camera_once(bpy, tmp_path):
    camera = add_camera(bpy)
    camera.location = (1, 2, 3)
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png")))
    assert bpy.context.scene.camera == camera
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "b.png")))
    second = bpy.context.scene.camera
    assert second != camera
    assert tuple(second.matrix_world.translation) == (1, 2, 3)
    assert camera.data.background_images[0].image.name == "a.png"


def test_resolution_of_the_same_shape_stays(bpy, tmp_path):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = 600, 900
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.png", 60, 90)))
    assert (render.resolution_x, render.resolution_y) == (600, 900)


def test_resolution_stays_unless_ticked(bpy, tmp_path, extension):
    """The lens is then set for a photo that lies in the middle of the frame."""
    render = bpy.context.scene.render
    before = render.resolution_x, render.resolution_y
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.jpg", 60, 90, focal_35mm=28)))
    assert (render.resolution_x, render.resolution_y) == before == (1920, 1080)
    focal_photo = 28 * np.hypot(60, 90) / DIAGONAL_35MM
    camera = bpy.context.scene.camera
    assert focal_px(camera, *before) == pytest.approx(focal_photo * 1080 / 90, rel=1e-5)


def test_a_lens_is_a_guess_unless_a_camera_file_says_otherwise(bpy, tmp_path, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    photo = str(write_photo(tmp_path / "a.png"))
    ends = []
    pose = {"file": "a.png", "R": np.eye(3).tolist(), "t": [0, 0, 2.0]}
    for name, write in (
        ("whole", write_cameras),
        ("guessed", lambda path: write_cameras(path, focal_guessed=True)),
        ("pose", lambda path: path.write_text(json.dumps(pose))),
    ):
        write(tmp_path / f"{name}.json")
        bpy.ops.gssmc.add_photo(filepath=photo, camera="NEW", camera_file=str(tmp_path / f"{name}.json"))
        ends.append(bpy.context.scene.camera.data.gssmc.lens_state)
    bpy.ops.gssmc.add_photo(filepath=photo, camera="NEW")
    assert [*ends, bpy.context.scene.camera.data.gssmc.lens_state] == ["CALIBRATED", "GUESSED", "GUESSED", "GUESSED"]


def test_a_photo_with_exif_rotation_stands_upright(bpy, tmp_path):
    """Stored red over blue; orientation 6 turns it clockwise, so red is on the right. Blender itself would not turn it."""
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.jpg", 60, 90, orientation=6)))
    image = bpy.context.scene.camera.data.background_images[0].image
    assert tuple(image.size) == (90, 60)
    pixels = np.array(image.pixels[:]).reshape(60, 90, 4)
    np.testing.assert_allclose(pixels[30, 80, :3], (1, 0, 0), atol=0.02)
    np.testing.assert_allclose(pixels[30, 10, :3], (0, 0, 1), atol=0.02)


def test_an_upside_down_photo_stands_upright(bpy, tmp_path):
    bpy.ops.gssmc.add_photo(filepath=str(write_photo(tmp_path / "a.jpg", 60, 90, orientation=3)))
    image = bpy.context.scene.camera.data.background_images[0].image
    bottom_row = np.array(image.pixels[: 60 * 4]).reshape(60, 4)
    assert bottom_row[30, 0] > 0.9


def test_picking_a_photo_in_the_panel_shows_it(bpy, tmp_path):
    camera = add_camera(bpy)
    image = bpy.data.images.load(str(write_photo(tmp_path / "a.png")))
    camera.data.gssmc.photo = image
    assert [b.image for b in camera.data.background_images] == [image]


def not_there(path):
    return path


def no_picture(path):
    path.write_bytes(b"no picture at all")
    return path


@pytest.mark.parametrize("make", [not_there, no_picture])
def test_a_bad_photo_changes_nothing(bpy, tmp_path, make):
    before = counts(bpy)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.add_photo(filepath=str(make(tmp_path / "bad.jpg")))
    assert "Traceback" not in str(error.value)
    assert counts(bpy) == before
    assert bpy.context.scene.camera is None


def write_cameras(path, **changes):
    frame = {"file": "a.png", "width": 60, "height": 90, "fx": 80.0, "fy": 84.0, "cx": 31.0, "cy": 44.0}
    frame |= {"dist": [0.1, -0.05, 0.001, 0.002], "R": np.eye(3).tolist(), "t": [0.5, 0.25, 2.0]}
    path.write_text(json.dumps({"frames": [frame | changes, frame | {"file": "other.png", "fx": 10.0}]}))
    return path


def test_a_camera_file_gives_pose_lens_and_distortion(bpy, tmp_path, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    cameras = write_cameras(tmp_path / "cameras.json")
    photo = str(write_photo(tmp_path / "a.png"))
    bpy.ops.gssmc.add_photo(filepath=photo, camera_file=str(cameras), set_resolution=True)
    camera, render = bpy.context.scene.camera, bpy.context.scene.render
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(camera.matrix_world)[:3, 3], (-0.5, -0.25, -2.0), atol=1e-6)
    np.testing.assert_allclose(np.array(camera.matrix_world)[:3, :3], np.diag([1, -1, -1]), atol=1e-6)
    projection = np.array(
        camera.calc_matrix_camera(
            bpy.context.evaluated_depsgraph_get(), x=60, y=90, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
        )
    )
    np.testing.assert_allclose((projection[0, 0] * 30, projection[1, 1] * 45), (80, 84), rtol=1e-5)
    np.testing.assert_allclose(((1 - projection[0, 2]) * 30, (1 + projection[1, 2]) * 45), (31, 44), atol=1e-3)
    lens = camera.data.gssmc
    assert (lens.k1, lens.k2, lens.p1, lens.p2, lens.k3) == pytest.approx((0.1, -0.05, 0.001, 0.002, 0.0))


@pytest.mark.parametrize("splat", [True, False], ids=["beside a splat", "alone"])
def test_a_camera_file_without_a_pose_is_a_photo_to_be_found(bpy, tmp_path, splat_file, capfd, splat):
    """As on the command line: the lens counts where there is one, and the camera stands where it would without the file."""
    if splat:
        bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    photo, places = str(write_photo(tmp_path / "a.png")), []
    add_camera(bpy).location = (1, 2, 3)
    (tmp_path / "name.json").write_text('{"frames": ["a.png", "b.png"]}')
    for cameras in (write_cameras(tmp_path / "lens.json", R=None, t=None), tmp_path / "name.json"):
        assert bpy.ops.gssmc.add_photo(filepath=photo, camera="NEW", camera_file=str(cameras)) == {"FINISHED"}
        camera = bpy.context.scene.camera
        places.append((tuple(camera.location), camera.data.gssmc.lens_state, round(camera.data.gssmc.k1, 6)))
    assert places == [((1, 2, 3), "CALIBRATED", 0.1), ((1, 2, 3), "GUESSED", 0.0)]
    told = capfd.readouterr().out
    assert "The lens is that of the camera file, which has no pose for the photo; use Find Camera." in told
    assert "The camera file has neither pose nor lens for the photo; use Find Camera." in told


@pytest.mark.parametrize("changes", [{"file": "elsewhere.png"}, {"width": 80}, {"R": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}])
def test_a_camera_file_that_does_not_fit_changes_nothing(bpy, tmp_path, splat_file, changes):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    photo, cameras = write_photo(tmp_path / "a.png"), write_cameras(tmp_path / "cameras.json", **changes)
    before = counts(bpy)
    with pytest.raises(RuntimeError):
        bpy.ops.gssmc.add_photo(filepath=str(photo), camera_file=str(cameras))
    assert counts(bpy) == before
    assert bpy.context.scene.camera is None


@pytest.mark.parametrize("codec", ["NONE", "ZIP", "RLE"])
def test_st_maps_are_openexr_as_blender_has_it(bpy, extension, tmp_path, codec):
    """Blender reads what the engine writes, and the engine what Blender writes."""
    exr = extension("core.photos.containers.openexr")
    rows = np.random.default_rng(0).random((20, 31, 2)).astype(np.float32)
    exr.write_exr(tmp_path / "ours.exr", {"R": rows[..., 0], "G": rows[..., 1]})
    image = bpy.data.images.load(str(tmp_path / "ours.exr"))
    np.testing.assert_array_equal(np.array(image.pixels[:]).reshape(20, 31, 4)[::-1, :, :2].astype(np.float32), rows)
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGB", "32", codec
    image.save_render(str(tmp_path / "blender.exr"), scene=bpy.context.scene)
    back = exr.read_exr(tmp_path / "blender.exr")
    np.testing.assert_array_equal(np.stack([back["R"], back["G"]], axis=-1), rows)


WIDE = {"camera_model": "OPENCV_FISHEYE", "width": 600, "height": 400, "fx": 220.0, "fy": 220.0, "cx": 300.0, "cy": 200.0}


def test_a_photo_of_a_wide_lens_is_cut(bpy, extension, tmp_path, splat_file, capfd):
    """Behind the camera lies the pinhole picture of the photo's middle, at the photo's own pose, and it is what is refined."""
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Z_UP")
    photo = write_photo(tmp_path / "a.png", 600, 400)
    cameras = write_cameras(tmp_path / "cameras.json", **WIDE, coefficients={"k1": 0.01}, dist=None)
    assert bpy.ops.gssmc.add_photo(filepath=str(photo), camera_file=str(cameras), set_resolution=True) == {"FINISHED"}
    assert "The photo is used through a pinhole cut of 100 degrees out of its lens OPENCV_FISHEYE." in capfd.readouterr().out
    camera = bpy.context.scene.camera
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(camera.matrix_world)[:3, 3], (-0.5, -0.25, -2.0), atol=1e-6)
    (background,) = camera.data.background_images
    image = background.image
    width = round(2 * 220 * np.tan(np.radians(50)))
    assert image == camera.data.gssmc.photo and image.packed_file and image.size[0] == pytest.approx(width, abs=2)
    assert focal_px(camera, *image.size) == pytest.approx(220, rel=1e-3) and camera.data.gssmc.k1 == 0
    assert camera.data.gssmc.lens_state == "CALIBRATED"
    source = extension("gssmc_addon.photo.image").photo_source(image).read()
    cuts, lenses = extension("core.photos.wide.cut"), extension("core.geometry.wide_lens")
    size, lengths = (600, 400), (220.0, 220.0, 300.0, 200.0)
    lens = lenses.WideLens("OPENCV_FISHEYE", *size, *lengths, (("k1", 0.01),))
    true = cuts.central_photo(extension("core.photos.photo").read_photo(str(photo)), lens).photo
    assert np.abs(source.pixels.astype(int) - true.pixels).max() <= 1
    assert (source.mask is None) == (true.mask is None)


def test_a_panorama_is_refused_with_what_to_do(bpy, tmp_path, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    photo = write_photo(tmp_path / "a.png", 200, 100)
    panorama = {"camera_model": "EQUIRECTANGULAR", "width": 200, "height": 100}
    cameras, before = write_cameras(tmp_path / "cameras.json", **panorama), counts(bpy)
    with pytest.raises(RuntimeError, match=r"'a\.png' is a panorama, which the command 'refine' places"):
        bpy.ops.gssmc.add_photo(filepath=str(photo), camera_file=str(cameras))
    assert counts(bpy) == before


def test_a_camera_file_without_a_splat_changes_nothing(bpy, tmp_path):
    photo, cameras = write_photo(tmp_path / "a.png"), write_cameras(tmp_path / "cameras.json")
    before = counts(bpy)
    with pytest.raises(RuntimeError, match="splat"):
        bpy.ops.gssmc.add_photo(filepath=str(photo), camera_file=str(cameras))
    assert counts(bpy) == before
    assert bpy.context.scene.camera is None


def test_intrinsics_are_those_blender_draws_with(bpy, extension):
    """Our K against Blender's own projection matrix, over random lenses, sensors, fits, shifts and pixel aspects."""
    bridge, conventions = extension("gssmc_addon.camera.bridge"), extension("core.geometry.conventions")
    camera, scene = add_camera(bpy), bpy.context.scene
    rng = np.random.default_rng(4)
    for number in range(60):
        data = camera.data
        data.sensor_fit = ("AUTO", "HORIZONTAL", "VERTICAL")[number % 3]
        data.lens, data.sensor_width, data.sensor_height = rng.uniform(10, 120), rng.uniform(10, 40), rng.uniform(10, 40)
        data.shift_x, data.shift_y = rng.uniform(-0.4, 0.4, 2)
        scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = ((1, 1), (1, 1.5), (1.25, 1))[number // 3 % 3]
        width, height = (int(x) for x in rng.integers(100, 4000, 2))
        bpy.context.view_layer.update()
        matrix = np.array(
            camera.calc_matrix_camera(
                bpy.context.evaluated_depsgraph_get(),
                x=width,
                y=height,
                scale_x=scene.render.pixel_aspect_x,
                scale_y=scene.render.pixel_aspect_y,
            )
        )
        k = conventions.intrinsics_from_blender(bridge.read_lens(scene, data), width, height)
        np.testing.assert_allclose((k.fx, k.fy), (matrix[0, 0] * width / 2, matrix[1, 1] * height / 2), rtol=1e-5)
        centre = (1 - matrix[0, 2]) * width / 2, (1 + matrix[1, 2]) * height / 2
        np.testing.assert_allclose((k.cx, k.cy), centre, atol=2e-3)


def add_camera(bpy):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    return camera


def write_exr(bpy, path, light):
    """An OpenEXR file of (H, W, 4) linear values, by Blender itself: as data, for it would write a picture as seen."""
    image = bpy.data.images.new("made", light.shape[1], light.shape[0], alpha=True, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.ascontiguousarray(light[::-1], np.float32).ravel())
    image.file_format, image.filepath_raw = "OPEN_EXR", str(path)
    image.save()
    bpy.data.images.remove(image)
    return path


def test_an_exr_photo_is_read_by_blender_and_handed_to_the_engine(bpy, extension, tmp_path):
    light = np.full((40, 60, 4), 1, np.float32)
    light[..., :3] = np.linspace(0.01, 4, 60).reshape(1, 60, 1)
    light[:20, :, 0] = 0.01
    path = write_exr(bpy, tmp_path / "photo.exr", light)
    assert bpy.ops.gssmc.add_photo(filepath=str(path)) == {"FINISHED"}
    camera = bpy.context.scene.camera
    image = camera.data.background_images[0].image
    assert tuple(image.size) == (60, 40)
    photo = extension("gssmc_addon.photo.image").photo_source(image).read()
    assert (photo.width, photo.height) == (60, 40)
    assert photo.pixels[5, 50, 0] < 30  # the top is blue-green, and on top
    assert photo.pixels[35, 50, 0] > 200
    middle = (light[30, 30, 1] / np.quantile(light[..., :3].max(axis=2), 0.99)).item()
    assert photo.pixels[30, 30, 1] == pytest.approx(255 * (1.055 * middle ** (1 / 2.4) - 0.055), abs=1.5)


def test_a_squeezed_exr_is_shown_with_the_pixels_that_its_header_says(bpy, extension, tmp_path):
    light = np.full((40, 60, 4), 1, np.float32)
    light[..., :3] = np.linspace(0.01, 4, 60).reshape(1, 60, 1)
    path = write_exr(bpy, tmp_path / "squeezed.exr", light)
    data = path.read_bytes()
    said = data.index(b"pixelAspectRatio\0float\0") + len(b"pixelAspectRatio\0float\0") + 4
    path.write_bytes(data[:said] + struct.pack("<f", 2.0) + data[said + 4 :])
    assert bpy.ops.gssmc.add_photo(filepath=str(path), set_resolution=True) == {"FINISHED"}
    scene = bpy.context.scene
    render, camera = scene.render, scene.camera
    assert (render.pixel_aspect_x, render.pixel_aspect_y) == (2.0, 1.0)
    assert tuple(camera.data.background_images[0].image.display_aspect) == (2.0, 1.0)
    bridge = extension("gssmc_addon.camera.bridge")
    lens = bridge.photo_intrinsics(scene, camera.data, 60, 40)
    assert lens.fy == pytest.approx(2 * lens.fx, rel=1e-5)
    image = camera.data.background_images[0].image
    assert extension("gssmc_addon.photo.image").photo_source(image).read().pixel_aspect == 2.0


def test_an_exr_is_read_in_the_colour_space_that_the_user_says(bpy, extension, tmp_path):
    light = np.full((40, 60, 4), 1, np.float32)
    light[:20, :, :3], light[20:, :, :3] = (0.1, 0.5, 0.1), 0.5
    for number in (1, 2):
        path = write_exr(bpy, tmp_path / f"shot.{number:04d}.exr", light)
    module = extension("gssmc_addon.photo.image")
    as_written, aces = module.read_linear(str(path)), module.read_linear(str(path), "ACEScg")
    # ACEScg's green is purer than sRGB's: the other two channels get darker.
    assert aces.pixels[5, 5, 0] < as_written.pixels[5, 5, 0] - 10
    image = bpy.data.images.load(str(tmp_path / "shot.0001.exr"))
    image.source, image.colorspace_settings.name = "SEQUENCE", "ACEScg"
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.background_images.new().image = image
    plate = extension("gssmc_addon.plate.source").moving_photo(camera)
    np.testing.assert_array_equal(plate.frame_at(plate.scene_range[0]).read().pixels, aces.pixels)


def test_a_black_exr_is_one_sentence_and_no_data(bpy, tmp_path):
    path = write_exr(bpy, tmp_path / "black.exr", np.zeros((8, 8, 4), np.float32))
    before = counts(bpy)
    with pytest.raises(RuntimeError, match="black or transparent"):
        bpy.ops.gssmc.add_photo(filepath=str(path))
    assert counts(bpy) == before
