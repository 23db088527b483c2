"""Splats that Blender itself imported (5.3 and later): turned upright, refined against, and exported, which Blender cannot."""

import numpy as np
import pytest
from fox import DEPTH, FOX, centre_in_file, start_and_truth
from plyfile import PlyData
from samples import random_gaussians, write_ply


def import_natively(bpy, path):
    """Blender's own import; the object becomes the picked splat."""
    bpy.ops.wm.ply_import(filepath=str(path))
    obj = bpy.context.view_layer.objects.active
    bpy.context.scene.gssmc.splat = obj
    return obj


@pytest.fixture
def native(bpy, tmp_path):
    raw = random_gaussians(300, 3)
    return import_natively(bpy, write_ply(tmp_path / "scan.ply", raw)), raw


def test_ours_and_blenders_own_import_are_the_same_object(bpy, native, tmp_path, extension):
    obj, _ = native
    read = extension("gssmc_addon.splat.copy").read_splat
    bpy.ops.gssmc.import_splats(filepath=str(tmp_path / "scan.ply"))
    ours, theirs = read(bpy.context.scene.gssmc.splat), read(obj)
    for name in ("means", "scales", "rotations", "opacities", "sh"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-5, atol=1e-6, err_msg=name)


def test_it_is_exported_as_it_was(bpy, native, tmp_path):
    """Blender's own export of a splat writes a file without a single point, and says that it finished."""
    _, raw = native
    assert bpy.ops.gssmc.export_splats(filepath=str(tmp_path / "out.ply")) == {"FINISHED"}
    found = PlyData.read(str(tmp_path / "out.ply"))["vertex"]
    assert found.count == 300
    for name in ("x", "f_dc_1", "f_rest_0", "f_rest_44", "opacity", "scale_2"):
        np.testing.assert_allclose(found[name], raw[name], rtol=2e-5, atol=2e-6, err_msg=name)


def test_blender_imports_what_was_exported_where_it_stood(bpy, native, tmp_path):
    obj, _ = native
    obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.3, -0.2, 1.0), (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    bpy.ops.gssmc.export_splats(filepath=str(tmp_path / "out.ply"), coordinates="SCENE")
    again = import_natively(bpy, tmp_path / "out.ply")
    for k in (0, 123, 299):
        want = obj.matrix_world @ obj.data.attributes["position"].data[k].vector
        np.testing.assert_allclose(again.data.attributes["position"].data[k].vector, want, atol=1e-4)


def test_it_is_turned_upright(bpy, native):
    """Blender leaves the object as the file lies: with y down, on its side."""
    obj, _ = native
    assert bpy.ops.gssmc.up_axis(axis="Y_DOWN") == {"FINISHED"}
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(obj.matrix_world) @ (0, -1, 0, 0), (0, 0, 1, 0), atol=1e-6)


@pytest.mark.skipif(not FOX.exists(), reason="the fox scan (../shared/scenes/fox) is not here")
def test_a_fox_that_blender_imported_is_refined(bpy, tmp_path):
    splat = import_natively(bpy, FOX / "scene.ply")
    splat.rotation_euler = (-np.pi / 2, 0, 0)  # upright: the file's y points down
    bpy.context.view_layer.update()
    start, centre, r = start_and_truth(tmp_path, "0009.jpg")
    bpy.ops.gssmc.add_photo(filepath=str(FOX / "queries" / "0009.jpg"), camera_file=str(start))
    assert bpy.ops.gssmc.refine() == {"FINISHED"}
    camera = bpy.context.scene.camera
    bpy.context.view_layer.update()
    assert camera.data.gssmc.verdict == "TRUSTED"
    assert np.linalg.norm(centre_in_file(camera, splat) - centre) < 0.003 * DEPTH
    looking = np.array((splat.matrix_world.inverted() @ camera.matrix_world).to_3x3().normalized()) @ (0, 0, -1)
    assert np.degrees(np.arccos(np.clip(looking @ r[2], -1, 1))) < 0.2
