"""File > Import > Photo Cameras: Alembic through Blender's own reader, bad records, and files of capture apps."""

import json

import numpy as np
import pytest
from samples import counts, write_photo


@pytest.fixture
def scene(bpy, splat_file):
    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation="Y_UP")
    return bpy.context.scene


def placed(bpy, name):
    """A camera somewhere, with a lens of its own."""
    from mathutils import Euler, Matrix

    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    bpy.context.scene.collection.objects.link(camera)
    camera.matrix_world = Matrix.LocRotScale((1, 2, 3), Euler((1.2, 0.1, 0.5)), (1, 1, 1))
    camera.data.lens, camera.data.shift_x = 28, 0.02
    bpy.context.view_layer.update()
    return camera


def test_an_alembic_camera_comes_to_where_it_was_exported(bpy, extension, scene, tmp_path):
    """On a splat with y up, as Alembic has it, the way out by Blender's exporter and in again ends where it began."""
    camera = placed(bpy, "shot_01")
    for obj in scene.objects:
        obj.select_set(obj == camera)
    file = tmp_path / "cameras.abc"
    bpy.ops.wm.alembic_export(filepath=str(file), selected=True, start=1, end=1, as_background_job=False)
    wanted = np.array(camera.matrix_world)
    write_photo(tmp_path / "shot_01.png")
    before, selected = counts(bpy), list(bpy.context.selected_objects)
    assert bpy.ops.gssmc.import_cameras(filepath=str(file)) == {"FINISHED"}
    assert list(bpy.context.selected_objects) == selected and bpy.context.scene == scene
    after = counts(bpy)
    assert {kind: after[kind] - before[kind] for kind in after if after[kind] != before[kind]} == {
        "objects": 1,
        "cameras": 1,
        "images": 1,
    }
    got = scene.camera
    assert got != camera and got.data.background_images[0].image.name == "shot_01.png"
    np.testing.assert_allclose(np.array(got.matrix_world), wanted, atol=1e-5)
    lens = extension("gssmc_addon.camera.bridge").photo_intrinsics(scene, got.data, 60, 90)
    assert lens.fx == pytest.approx(28 / 36 * 90, rel=1e-4) and lens.fx == pytest.approx(lens.fy, rel=1e-5)


def test_an_alembic_file_without_cameras_changes_nothing(bpy, scene, tmp_path):
    mesh = bpy.data.objects.new("mesh", bpy.data.meshes.new("mesh"))
    scene.collection.objects.link(mesh)
    for obj in scene.objects:
        obj.select_set(obj == mesh)
    file = tmp_path / "mesh.abc"
    bpy.ops.wm.alembic_export(filepath=str(file), selected=True, start=1, end=1, as_background_job=False)
    before, meshes = counts(bpy), len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match="holds no camera; export the cameras into it"):
        bpy.ops.gssmc.import_cameras(filepath=str(file))
    whole = file.read_bytes()
    for size in (10, 200, len(whole) // 2, len(whole) - 1):
        (tmp_path / "broken.abc").write_bytes(whole[:size])
        with pytest.raises(RuntimeError, match="is no whole Alembic file; export it again"):
            bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "broken.abc"))
    assert counts(bpy) == before and len(bpy.data.meshes) == meshes


def test_one_bad_record_leaves_the_others_to_import_and_to_add_folder(bpy, scene, tmp_path):
    photos = tmp_path / "photos"
    photos.mkdir()
    good = {"width": 60, "height": 90, "fx": 80, "fy": 80, "cx": 30, "cy": 45, "R": np.eye(3).tolist(), "t": [0, 0, 2]}
    frames = [{**good, "file": f"{name}.png"} for name in "abc"]
    frames[1]["t"] = [float("-inf"), 0, 0]
    frames[2] |= {"width": 90, "height": 60}
    for name in "abc":
        write_photo(photos / f"{name}.png")
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"frames": frames}).replace("-Infinity", "-1e999"))
    assert bpy.ops.gssmc.import_cameras(filepath=str(file), photos=str(photos)) == {"FINISHED"}
    assert scene.camera.name == "a"
    assert bpy.ops.gssmc.add_photo_folder(directory=str(photos), camera_file=str(file)) == {"FINISHED"}
    assert [row.camera is not None for row in scene.gssmc.photos] == [True, False, False]


def test_a_photo_that_blender_cannot_read_is_shown_as_a_copy_and_a_damaged_one_costs_no_other(bpy, scene, tmp_path):
    from photo_files import LONG, SHORT, TiffFile, encoded, exif, picture

    file = TiffFile()
    thumbnail = file.directory(file.strip(picture(12, 16), t254=1))
    file.follow(thumbnail, file.directory({**file.strip(picture(48, 64)), 254: (LONG, (0,))}))
    (tmp_path / "a.dng").write_bytes(bytes(file.data))
    damaged = bytearray(encoded(".png", picture(48, 64), exif({0x0112: (SHORT, 3)})))
    damaged[damaged.index(b"IDAT") + 20] ^= 1
    (tmp_path / "b.png").write_bytes(bytes(damaged))
    lens = {"width": 64, "height": 48, "fx": 80, "fy": 80, "cx": 32, "cy": 24}
    frames = [{**lens, "R": np.eye(3).tolist(), "t": [0, 0, 2], "file": name} for name in ("a.DNG", "b.png")]
    (tmp_path / "cameras.json").write_text(json.dumps({"frames": frames}))
    assert bpy.ops.gssmc.import_cameras(filepath=str(tmp_path / "cameras.json")) == {"FINISHED"}
    image = scene.camera.data.background_images[0].image
    assert tuple(image.size) == (64, 48)
    shown = np.array(image.pixels).reshape(48, 64, 4)[::-1, :, :3] * 255
    np.testing.assert_allclose(shown, picture(48, 64), atol=1)
