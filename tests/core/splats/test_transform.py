"""A moved scene, seen by a camera moved alike, is the same picture: by the renderer's plain twin, which turns no harmonics."""

from dataclasses import replace

import numpy as np
import pytest
from render_scenes import cloud, make_scene

from core.geometry.camera import Intrinsics, Pose
from core.geometry.conventions import Similarity, orientation_matrix
from core.geometry.lie import so3_exp
from core.render import RenderSettings
from core.render.reference import render_reference, sh_basis
from core.splats.scene import SH_COEFFICIENTS
from core.splats.transform import sh_rotation, transformed
from core.splats.turn import turned

LENS = Intrinsics(40, 30, 32.0, 31.0, 20.5, 15.0)
POSE = Pose(so3_exp([0.1, -0.2, 0.05]), np.array([0.1, -0.2, 0.3]))
NEAR = RenderSettings().near
MOVE = Similarity(2.5, so3_exp([0.7, -1.9, 1.1]), np.array([3.0, -8.0, 5.0]))


def scene(coefficients):
    means, scales = cloud(150, seed=coefficients)
    return make_scene(means, scales, coefficients=coefficients)


@pytest.mark.parametrize("coefficients", SH_COEFFICIENTS)
@pytest.mark.parametrize("rotation", [so3_exp([0.7, -1.9, 1.1]), orientation_matrix("Y_DOWN")[:3, :3], np.eye(3)])
def test_a_camera_moved_alike_sees_the_same(coefficients, rotation):
    before, move = scene(coefficients), replace(MOVE, rotation=rotation)
    after = transformed(before, move, "Z_UP")
    want = render_reference(before, LENS, POSE, RenderSettings(near=NEAR))
    got = render_reference(after, LENS, move.pose_to_scene(POSE), RenderSettings(near=NEAR * move.scale))
    assert want.alpha.max() > 0.9
    np.testing.assert_allclose(got.color, want.color, atol=2e-4)
    np.testing.assert_allclose(got.alpha, want.alpha, atol=2e-4)
    np.testing.assert_allclose(got.depth, want.depth * move.scale, rtol=1e-4, atol=1e-3)
    assert (after.orientation, after.dropped, len(after)) == ("Z_UP", before.dropped, len(before))
    assert all(getattr(after, name).dtype == np.float32 for name in ("means", "scales", "rotations", "opacities", "sh"))


def test_the_picture_would_show_harmonics_that_stay_behind():
    """What Blender's own Apply Transform does: means and sizes move, colours seen from the side do not."""
    before = scene(16)
    after = replace(transformed(before, MOVE, "Z_UP"), sh=before.sh)
    want = render_reference(before, LENS, POSE, RenderSettings(near=NEAR))
    got = render_reference(after, LENS, MOVE.pose_to_scene(POSE), RenderSettings(near=NEAR * MOVE.scale))
    assert np.abs(got.color - want.color).max() > 0.1


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_turned_function_has_the_old_value_at_the_old_direction(degree):
    rng = np.random.default_rng(degree)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    band = slice(degree**2, (degree + 1) ** 2)
    turn, coefficients = so3_exp([0.3, 2.0, -1.0]), rng.normal(size=2 * degree + 1)
    moved = sh_rotation(turn, degree) @ coefficients
    here = [sh_basis(d, degree)[band] @ moved for d in directions]
    there = [sh_basis(turn.T @ d, degree)[band] @ coefficients for d in directions]
    np.testing.assert_allclose(here, there, atol=1e-12)
    np.testing.assert_allclose(sh_rotation(turn, degree).T @ sh_rotation(turn, degree), np.eye(2 * degree + 1), atol=1e-12)


def test_the_half_turn_is_that_of_the_formats():
    before = scene(16)
    want = turned(before, "Y_UP")
    got = transformed(before, Similarity(1.0, np.diag([1.0, -1.0, -1.0]), np.zeros(3)), "Y_UP")
    np.testing.assert_allclose(got.means, want.means, atol=1e-6)
    np.testing.assert_allclose(got.sh, want.sh, atol=1e-5)


def test_back_again_is_the_scene_itself():
    before = scene(16)
    after = transformed(transformed(before, MOVE, "Z_UP"), MOVE.inverse(), "Y_DOWN")
    np.testing.assert_allclose(after.means, before.means, atol=1e-5)
    np.testing.assert_allclose(after.scales, before.scales, rtol=1e-6)
    np.testing.assert_allclose(after.sh, before.sh, atol=1e-5)
    same = np.sign((after.rotations * before.rotations).sum(1))[:, None]  # q and -q are one rotation
    np.testing.assert_allclose(after.rotations * same, before.rotations, atol=1e-6)
