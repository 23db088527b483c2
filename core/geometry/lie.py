"""SO(3) and SE(3): exponential, logarithm and left Jacobians. Vectors of se(3) are (rho, phi): translation part first.

T(xi) = [exp(phi), J(phi) rho; 0 1] with J the left Jacobian of SO(3) (the paper's J).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .camera import Pose

FloatArray = NDArray[np.float64]

SMALL_ANGLE = 1e-5  # radians; below it the closed forms lose digits and the series are exact to double precision
NEAR_PI = 1e-4  # radians from pi where the sine form of the logarithm loses its axis


def hat(v: ArrayLike) -> FloatArray:
    """Skew-symmetric matrix (..., 3, 3) of v (..., 3): hat(v) w = v x w."""
    v = np.asarray(v, np.float64)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def so3_exp(phi: ArrayLike) -> FloatArray:
    """Rotation matrix (3, 3) of the rotation vector phi (3,), radians (Rodrigues)."""
    phi = np.asarray(phi, np.float64)
    angle = float(np.linalg.norm(phi))
    K = hat(phi)
    if angle < SMALL_ANGLE:
        return np.eye(3) + K + 0.5 * K @ K
    return np.asarray(np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K)


def so3_log(R: ArrayLike) -> FloatArray:
    """Rotation vector (3,), radians, |phi| <= pi, of the rotation matrix R (3, 3)."""
    R = np.asarray(R, np.float64)
    w = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(w))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(R) - 1)))
    if angle < SMALL_ANGLE:
        return w
    if np.pi - angle > NEAR_PI:
        return w * (angle / sine)
    # Near pi the axis stands in the symmetric part: (R + R^T)/2 = cos I + (1 - cos) a a^T.
    S = 0.5 * (R + R.T) - np.cos(angle) * np.eye(3)
    axis = S[:, int(np.argmax(np.diag(S)))]
    axis = axis / np.linalg.norm(axis)
    return np.asarray(angle * axis * (1.0 if axis @ w >= 0 else -1.0))


def left_jacobian(phi: ArrayLike) -> FloatArray:
    """Left Jacobian J (3, 3) of SO(3): exp(phi + d) ~ exp(J d) exp(phi)."""
    phi = np.asarray(phi, np.float64)
    angle = float(np.linalg.norm(phi))
    K = hat(phi)
    if angle < SMALL_ANGLE:
        return np.eye(3) + 0.5 * K + K @ K / 6
    a2 = angle * angle
    return np.asarray(np.eye(3) + (1 - np.cos(angle)) / a2 * K + (angle - np.sin(angle)) / (a2 * angle) * K @ K)


def left_jacobian_inverse(phi: ArrayLike) -> FloatArray:
    """Inverse of the left Jacobian of SO(3), (3, 3)."""
    phi = np.asarray(phi, np.float64)
    angle = float(np.linalg.norm(phi))
    K = hat(phi)
    if angle < SMALL_ANGLE:
        return np.eye(3) - 0.5 * K + K @ K / 12
    half = 0.5 * angle
    return np.asarray(np.eye(3) - 0.5 * K + (1 - half / np.tan(half)) / (angle * angle) * K @ K)


def se3_log(pose: Pose) -> FloatArray:
    """The vector xi = (rho, phi) (6,) whose `se3_exp` is `pose`."""
    phi = so3_log(pose.R)
    return np.concatenate([left_jacobian_inverse(phi) @ pose.t, phi])


def adjoint(pose: Pose) -> FloatArray:
    """The matrix (6, 6) with exp(adjoint xi) = pose exp(xi) pose^-1."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = pose.R
    out[:3, 3:] = hat(pose.t) @ pose.R
    return out


def se3_exp(xi: ArrayLike) -> Pose:
    """The rigid motion of xi (6,) = (rho, phi): scene units, radians."""
    xi = np.asarray(xi, np.float64)
    return Pose(so3_exp(xi[3:]), left_jacobian(xi[3:]) @ xi[:3])
