"""Unit quaternions w x y z, of pose files and of Gaussians, to and from rotation matrices."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import CameraError
from .camera import FloatArray

Floating = TypeVar("Floating", np.float32, np.float64)

LENGTH_TOLERANCE = 0.02  # files round their digits; a length further from 1 means that these columns are something else


def rotations_of(quaternions: NDArray[Floating]) -> NDArray[Floating]:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), in the precision of the quaternions."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows, quaternions.dtype), (0, 1), (-2, -1))


def rotation_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """Rotation matrix (3, 3) of a quaternion w x y z. Raises CameraError when its length is not 1 within 2 %."""
    q = np.asarray(quaternion, np.float64)
    if q.shape != (4,) or not np.isfinite(q).all():
        raise CameraError("The quaternion is not made of four finite numbers; give w x y z.")
    length = float(np.linalg.norm(q))
    if not abs(length - 1) <= LENGTH_TOLERANCE:
        raise CameraError(f"The quaternion has length {length:.3g} instead of 1; its order must be w x y z.")
    return rotations_of(q / length)


def quaternion_from_rotation(R: ArrayLike) -> FloatArray:
    """Unit quaternion w x y z, w >= 0, of a rotation matrix (3, 3).

    Each row below is 4 q_i q, so the row of the largest component gives q without cancellation.
    """
    m = np.asarray(R, np.float64)
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    x, y, z = np.diag(m)
    rows = np.array([[1 + x + y + z, a, b, c], [a, 1 + x - y - z, d, e], [b, d, 1 - x + y - z, f], [c, e, f, 1 - x - y + z]])
    q = rows[int(np.argmax(np.diag(rows)))]
    q = q / np.linalg.norm(q)
    return np.asarray(-q if q[0] < 0 else q)
