"""File > Export > Gaussian Splats: what plyfile reads of the file, and what the engine's slow renderer sees in it."""

import numpy as np
import pytest
from plyfile import PlyData
from samples import counts, random_gaussians, write_ply

from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.render import RenderSettings
from core.render.reference import render_reference
from core.splats import read_splats

LENS = Intrinsics(48, 36, 40.0, 40.0, 24.0, 18.0)
PLACE = {"location": (1.0, -2.0, 3.0), "rotation_euler": (0.4, -0.7, 1.2), "scale": (2.5, 2.5, 2.5)}


@pytest.fixture
def splat(bpy, tmp_path):
    """A splat of SH degree 3 that its user has moved, turned and made larger."""
    raw = random_gaussians(200, 3)
    for axis in range(3):
        raw[f"scale_{axis}"] += 2  # large enough to fill the picture
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "scan.ply", raw)))
    obj = bpy.context.scene.gssmc.splat
    for name, value in PLACE.items():
        setattr(obj, name, value)
    bpy.context.view_layer.update()
    return obj, raw


def export(bpy, path, coordinates):
    assert bpy.ops.gssmc.export_splats(filepath=str(path), coordinates=coordinates) == {"FINISHED"}
    return path


def moved(matrix, pose):
    """`pose` carried along by a 4x4 matrix of Blender's, with numpy alone: x_c = R x + t for x = M^-1 x'."""
    size = np.cbrt(np.linalg.det(matrix[:3, :3]))
    rotation = pose.R @ (matrix[:3, :3] / size).T
    centre = matrix[:3, :3] @ pose.centre + matrix[:3, 3]
    return Pose(rotation, -rotation @ centre), size


def test_the_object_s_own_coordinates_are_the_file_s(bpy, splat, tmp_path):
    _, raw = splat
    found = PlyData.read(str(export(bpy, tmp_path / "out.ply", "OBJECT")))["vertex"]
    turn = np.stack([raw[f"rot_{k}"] for k in range(4)], axis=1).astype(float)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    for name, values in raw.items():
        want = turn[:, int(name[-1])] if name.startswith("rot_") else values
        np.testing.assert_allclose(found[name], want, rtol=2e-5, atol=2e-6, err_msg=name)


@pytest.mark.parametrize("coordinates", ["SCENE", "SCENE_Y_DOWN"])
def test_the_scene_s_coordinates_show_the_same_to_a_camera_moved_alike(bpy, splat, tmp_path, coordinates):
    obj, _ = splat
    matrix = np.array(obj.matrix_world, float)
    if coordinates == "SCENE_Y_DOWN":
        matrix = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]) @ matrix
    pose = Pose(so3_exp([0.2, 0.1, -0.1]), np.array([0.0, 0.0, 5.0]))
    after, size = moved(matrix, pose)
    file = export(bpy, tmp_path / "out.ply", coordinates)
    want = render_reference(read_splats(tmp_path / "scan.ply"), LENS, pose, RenderSettings(near=0.2))
    got = render_reference(read_splats(file), LENS, after, RenderSettings(near=0.2 * size))
    assert want.alpha.mean() > 0.5
    np.testing.assert_allclose(got.color, want.color, atol=2e-3)
    np.testing.assert_allclose(got.alpha, want.alpha, atol=2e-3)


@pytest.mark.parametrize(("coordinates", "orientation"), [("SCENE", "Z_UP"), ("SCENE_Y_DOWN", "AUTO")])
def test_imported_again_it_stands_where_it_stood(bpy, splat, tmp_path, coordinates, orientation):
    obj, _ = splat
    bpy.ops.gssmc.import_splats(filepath=str(export(bpy, tmp_path / "out.ply", coordinates)), orientation=orientation)
    again = bpy.context.scene.gssmc.splat
    assert again is not obj
    for k in (0, 57, 199):
        before, after = (o.matrix_world @ o.data.attributes["position"].data[k].vector for o in (obj, again))
        np.testing.assert_allclose(after, before, atol=1e-4)
        sizes = [np.array(o.data.attributes["scale"].data[k].vector) * o.matrix_world.to_scale()[0] for o in (obj, again)]
        np.testing.assert_allclose(*sizes, rtol=1e-4)


def test_the_active_splat_goes_before_the_picked_one(bpy, splat, tmp_path):
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "b.ply", random_gaussians(30, 0))))
    picked, (obj, _) = bpy.context.scene.gssmc.splat, splat
    assert len(read_splats(export(bpy, tmp_path / "picked.ply", "OBJECT"))) == 30
    picked.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    assert len(read_splats(export(bpy, tmp_path / "active.ply", "OBJECT"))) == 200


def test_what_cannot_be_written_is_one_sentence_and_the_old_file_stays(bpy, splat, tmp_path):
    obj, _ = splat
    file = tmp_path / "out.ply"
    file.write_text("mine")
    before = counts(bpy)
    obj.scale = (1.0, 2.0, 1.0)
    with pytest.raises(RuntimeError, match=r"scaled unevenly .*; give it the same scale in x, y and z"):
        bpy.ops.gssmc.export_splats(filepath=str(file), coordinates="SCENE")
    assert file.read_text() == "mine"
    export(bpy, tmp_path / "own.ply", "OBJECT")  # its own coordinates know no scale
    obj.scale = (1.0, 1.0, 1.0)
    with pytest.raises(RuntimeError, match="cannot be written"):
        bpy.ops.gssmc.export_splats(filepath=str(file / "out.ply"))
    assert counts(bpy) == before
    assert sorted(p.name for p in tmp_path.glob("*.ply")) == ["out.ply", "own.ply", "scan.ply"]


def test_broken_gaussians_are_left_out_with_a_word(bpy, splat, tmp_path, capfd):
    obj, _ = splat
    obj.data.attributes["position"].data[7].vector = (np.nan, 0, 0)
    assert len(read_splats(export(bpy, tmp_path / "out.ply", "SCENE"))) == 199
    assert "1 Gaussian with values that are not finite was left out" in capfd.readouterr().out


def test_without_a_splat_there_is_nothing_to_export(bpy):
    assert not bpy.ops.gssmc.export_splats.poll()
