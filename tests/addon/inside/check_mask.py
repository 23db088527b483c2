"""Masks in Blender: from a file, painted, or a folder by name; refused in a sentence; kept in the .blend and honoured."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import rooms
from samples import counts, random_gaussians, write_photo, write_ply

SIZE = (rooms.WIDTH, rooms.HEIGHT)


def mask_file(path, size=SIZE, black=0.25):
    """The left quarter of the upper half is black: neither mirrored nor upside down is it the same."""
    picture = np.full(size[::-1], 255, np.uint8)
    picture[: size[1] // 2, : int(size[0] * black)] = 0
    assert cv2.imwrite(str(path), picture)
    return path


def kept(size=SIZE):
    white = np.ones(size[::-1], bool)
    white[: size[1] // 2, : size[0] // 4] = False
    return white


def read_for_refine(extension, scene, camera):
    """The photo as Refine would take it."""
    settings = extension("core.pose.settings").RefineSettings(**rooms.QUICK)
    jobs = extension("gssmc_addon.refine.job")
    return jobs.prepare(scene, scene.gssmc.splat, camera, settings).inputs.photo.read()


def test_a_file_becomes_the_mask_and_stays_in_the_blend(bpy, listed, extension, tmp_path):
    assert read_for_refine(extension, listed, listed.camera).mask is None
    assert bpy.ops.gssmc.set_mask(filepath=str(mask_file(tmp_path / "people.png"))) == {"FINISHED"}
    np.testing.assert_array_equal(read_for_refine(extension, listed, listed.camera).mask, kept())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    assert Path(bpy.path.abspath(scene.camera.data.gssmc.mask.filepath)).name == "people.png"
    np.testing.assert_array_equal(read_for_refine(extension, scene, scene.camera).mask, kept())
    assert scene.objects["p1"].data.gssmc.mask is None


@pytest.mark.parametrize("kind", ["painted", "packed", "exr"])
def test_a_picture_that_only_blender_has_is_taken_as_it_is(bpy, listed, extension, tmp_path, kind):
    image = bpy.data.images.new("mask", *SIZE, float_buffer=kind == "exr", is_data=True)
    pixels = np.ones((*SIZE[::-1], 4), np.float32)
    pixels[..., :3] = kept()[::-1, :, None]  # Blender's first row is the bottom one
    image.pixels.foreach_set(pixels.ravel())
    if kind == "packed":
        image.pack()
    if kind == "exr":
        image.filepath_raw, image.file_format = str(tmp_path / "mask.exr"), "OPEN_EXR"
        image.save()
        image = bpy.data.images.load(str(tmp_path / "mask.exr"))
    listed.camera.data.gssmc.mask = image
    np.testing.assert_array_equal(read_for_refine(extension, listed, listed.camera).mask, kept())


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("has 100 x 240 pixels but its photo 320 x 240", "size.png"),
        ("leaves nothing of the photo", "black.png"),
        ("cannot be decoded", "text.png"),
        ("There is no mask at", "gone.png"),
    ],
)
def test_a_mask_that_does_not_fit_is_refused_and_nothing_changes(bpy, listed, tmp_path, words, name):
    mask_file(tmp_path / "size.png", (100, 240))
    assert cv2.imwrite(str(tmp_path / "black.png"), np.zeros(SIZE[::-1], np.uint8))
    (tmp_path / "text.png").write_text("no picture")
    before = counts(bpy)
    with pytest.raises(RuntimeError, match=words) as error:
        bpy.ops.gssmc.set_mask(filepath=str(tmp_path / name))
    assert "Traceback" not in str(error.value)
    assert counts(bpy) == before
    assert listed.camera.data.gssmc.mask is None


def test_the_sentence_reaches_refine_and_its_line_of_the_list(bpy, listed, tmp_path):
    own = listed.gssmc
    cameras = [entry.camera for entry in own.photos]
    cameras[0].data.gssmc.mask = bpy.data.images.load(str(mask_file(tmp_path / "size.png", (100, 240))))
    cameras[1].data.gssmc.mask = bpy.data.images.load(str(mask_file(tmp_path / "good.png")))
    own.photos[2].ticked = False
    with pytest.raises(RuntimeError, match="has 100 x 240 pixels"):
        bpy.ops.gssmc.refine(camera="p0", **rooms.QUICK)
    assert bpy.ops.gssmc.refine_all(which="TICKED", **rooms.QUICK) == {"FINISHED"}
    assert "has 100 x 240 pixels" in own.photos[0].error
    assert own.photos[1].error == ""
    assert cameras[1].data.gssmc.verdict in ("TRUSTED", "CHECK")
    cameras[0].data.gssmc.mask.source = "SEQUENCE"
    with pytest.raises(RuntimeError, match="no single picture"):
        bpy.ops.gssmc.refine(camera="p0", **rooms.QUICK)


def test_a_folder_gives_each_photo_its_mask(bpy, listed, tmp_path):
    mask_file(tmp_path / "p0.png.png")
    mask_file(tmp_path / "p2.jpg")
    assert bpy.ops.gssmc.set_masks(directory=str(tmp_path)) == {"FINISHED"}
    masks = [entry.camera.data.gssmc.mask for entry in listed.gssmc.photos]
    assert [mask.name if mask else "" for mask in masks] == ["p0.png.png", "", "p2.jpg"]
    assert bpy.ops.gssmc.set_masks(directory=str(mask_folder(tmp_path))) == {"CANCELLED"}
    with pytest.raises(RuntimeError, match="no mask or folder of masks"):
        bpy.ops.gssmc.set_masks(directory=str(tmp_path / "gone"))
    before = len(bpy.data.images)
    bpy.ops.gssmc.remove_photo()
    assert len(bpy.data.images) == before - 2  # photo and mask


def mask_folder(folder):
    (folder / "empty").mkdir()
    return folder / "empty"


def test_a_photo_that_exif_turns_is_masked_as_it_is_seen(bpy, extension, tmp_path):
    """Blender holds a turned copy; its mask is found by the file's name."""
    (tmp_path / "photos").mkdir()
    (tmp_path / "masks").mkdir()
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "scan.ply", random_gaussians(50, 0))))
    write_photo(tmp_path / "photos" / "a.jpg", 60, 90, orientation=6)
    mask_file(tmp_path / "masks" / "a.jpg.png", (90, 60))
    bpy.ops.gssmc.add_photo(filepath=str(tmp_path / "photos" / "a.jpg"), camera="NEW")
    assert bpy.ops.gssmc.set_masks(directory=str(tmp_path / "masks")) == {"FINISHED"}
    scene = bpy.context.scene
    source = extension("gssmc_addon.photo.mask")
    photo = extension("gssmc_addon.photo.image").photo_source(scene.camera.data.gssmc.photo)
    white = source.masked(photo, source.of(scene.camera)).read().mask
    assert white.shape == (60, 90)
    assert not white[:30, :22].any()
    assert white[30:].all()


def test_without_a_photo_there_is_nothing_to_mask(bpy, tmp_path):
    with pytest.raises(RuntimeError, match="no photo to mask"):
        bpy.ops.gssmc.set_mask(filepath=str(mask_file(tmp_path / "m.png")))
    assert not bpy.ops.gssmc.set_masks.poll()


@pytest.mark.parametrize("command", ["refine", "batch"])
def test_the_command_lines_mask_is_saved_with_the_scene(bpy, extension, tmp_path, command):
    write_ply(tmp_path / "scan.ply", random_gaussians(300, 0))
    write_photo(tmp_path / "a.png")
    camera = {"file": "a.png", "width": 60, "height": 90, "fx": 80, "fy": 80, "cx": 30, "cy": 45, "dist": [0, 0, 0, 0]}
    (tmp_path / "c.json").write_text(json.dumps({"frames": [camera | {"R": np.eye(3).tolist(), "t": [0, 0, 6.0]}]}))
    (tmp_path / "masks").mkdir()
    mask_file(tmp_path / "masks" / "a.png", (60, 90))
    words = {"refine": ["a.png", "--camera", "c.json"], "batch": ["c.json", "--workers", "1"]}[command]
    words = [str(tmp_path / word) if "." in word else word for word in words]
    files = ["--mask", str(tmp_path / "masks"), "--out", str(tmp_path / "r.json"), "--blend", str(tmp_path / "o.blend")]
    assert extension("gssmc_addon.headless.command").main([command, str(tmp_path / "scan.ply"), *words, *files]) == 3
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "o.blend"))
    assert bpy.context.scene.camera.data.gssmc.mask.filepath == "//masks/a.png"
