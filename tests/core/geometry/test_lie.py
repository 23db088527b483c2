"""SE(3) against SciPy's matrix exponential and finite differences."""

import numpy as np
import pytest
from scipy.linalg import expm

from core.geometry.lie import hat, left_jacobian, left_jacobian_inverse, se3_exp, so3_exp, so3_log

ANGLES = [0.0, 1e-9, 1e-6, 3e-5, 0.1, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-6]


def _axis(seed: int) -> np.ndarray:
    v = np.random.default_rng(seed).normal(size=3)
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("angle", ANGLES)
def test_so3_exp_is_the_matrix_exponential(angle):
    phi = angle * _axis(1)
    np.testing.assert_allclose(so3_exp(phi), expm(hat(phi)), atol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("seed", range(5))
def test_so3_log_inverts_exp(angle, seed):
    phi = angle * _axis(seed)
    np.testing.assert_allclose(so3_log(expm(hat(phi))), phi, atol=1e-8)


def test_so3_log_at_pi_gives_the_axis_up_to_sign():
    axis = _axis(3)
    phi = so3_log(2 * np.outer(axis, axis) - np.eye(3))
    np.testing.assert_allclose(np.abs(phi @ axis), np.pi, atol=1e-7)


@pytest.mark.parametrize("angle", [1e-7, 1e-3, 0.7, 2.5])
def test_left_jacobian_is_the_derivative_of_exp(angle):
    phi, eps = angle * _axis(2), 1e-6
    numeric = np.empty((3, 3))
    for k in range(3):
        d = np.eye(3)[k] * eps
        numeric[:, k] = (so3_log(so3_exp(phi + d) @ so3_exp(phi).T) - so3_log(so3_exp(phi - d) @ so3_exp(phi).T)) / (2 * eps)
    np.testing.assert_allclose(left_jacobian(phi), numeric, atol=1e-8)
    np.testing.assert_allclose(left_jacobian(phi) @ left_jacobian_inverse(phi), np.eye(3), atol=1e-10)


@pytest.mark.parametrize("angle", ANGLES[:-2])
def test_se3_exp_is_the_matrix_exponential(angle):
    xi = np.concatenate([[0.3, -2.0, 5.0], angle * _axis(4)])
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = hat(xi[3:]), xi[:3]
    want = expm(twist)
    pose = se3_exp(xi)
    np.testing.assert_allclose(pose.R, want[:3, :3], atol=1e-10)
    np.testing.assert_allclose(pose.t, want[:3, 3], atol=1e-8)
