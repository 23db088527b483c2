"""Quaternions as pose files write them."""

import numpy as np
import pytest
from dataset_files import QUATERNION, R
from scipy.spatial.transform import Rotation

from core.errors import CameraError
from core.geometry.lie import so3_exp
from core.geometry.quaternion import quaternion_from_rotation, rotation_from_quaternion, rotations_of


def test_a_quarter_turn_and_a_third_of_a_turn_by_hand():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(rotation_from_quaternion([half, 0, 0, half]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(rotation_from_quaternion(QUATERNION), R, atol=1e-15)
    np.testing.assert_allclose(quaternion_from_rotation(R), QUATERNION, atol=1e-15)


@pytest.mark.parametrize("degrees", [0, 1e-7, 30, 119.9, 179.9999, 180])
def test_half_the_angle_about_the_axis_is_what_the_quaternion_says(degrees):
    axis = np.array([2.0, -3.0, 6.0]) / 7
    angle = np.radians(degrees)
    q = quaternion_from_rotation(so3_exp(angle * axis))
    np.testing.assert_allclose(np.abs(q), np.abs([np.cos(angle / 2), *(np.sin(angle / 2) * axis)]), atol=1e-14)
    np.testing.assert_allclose(rotation_from_quaternion(q), so3_exp(angle * axis), atol=1e-14)
    assert q[0] >= 0


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (1, 1, 0, 0)])
def test_what_is_no_unit_quaternion_is_refused(q):
    with pytest.raises(CameraError, match="instead of 1; its order must be w x y z"):
        rotation_from_quaternion(q)


@pytest.mark.parametrize("q", [(float("nan"), 0, 0, 0), (1, 0, 0), (float("inf"), 0, 0, 0)])
def test_what_is_no_quaternion_at_all_is_refused_without_a_nan_in_the_sentence(q):
    with pytest.raises(CameraError, match="not made of four finite numbers") as caught:
        rotation_from_quaternion(q)
    assert "nan" not in str(caught.value)


def test_many_rotations_at_once_are_scipys_in_either_precision():
    q = np.random.default_rng(0).normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    want = Rotation.from_quat(q, scalar_first=True).as_matrix()
    np.testing.assert_allclose(rotations_of(q), want, atol=1e-14)
    single = rotations_of(q.astype(np.float32))
    assert single.dtype == np.float32 and single.shape == (50, 3, 3)
    np.testing.assert_allclose(single, want, atol=1e-6)
    np.testing.assert_allclose(rotations_of(q[0]), want[0], atol=1e-14)


def test_rounded_digits_are_no_obstacle():
    np.testing.assert_allclose(rotation_from_quaternion([0.7071, 0, 0, 0.7072]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=2e-4)
