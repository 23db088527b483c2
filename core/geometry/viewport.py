"""A 3D viewport as the engine's camera: of a perspective projection matrix as OpenGL has it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import CameraError
from .camera import Intrinsics


def intrinsics_from_projection(projection: ArrayLike, width: int, height: int) -> Intrinsics:
    """The intrinsics of a region of `width` x `height` pixels with the 4x4 OpenGL `projection` (x right, y up, -z forward).

    With x_ndc = (P00 x + P02 z) / -z, and the engine's (x, y, z) = (x, -y, -z), the pixel is W/2 (1 - P02 + P00 x/z) across and
    H/2 (1 + P12 + P11 y/z) down. Raises CameraError for an orthographic projection.
    """
    P = np.asarray(projection, np.float64)
    if P[3, 2] >= 0 or P[3, 3] != 0:
        raise CameraError("The view is orthographic; switch it to perspective (numpad 5).")
    fx, fy = width / 2 * P[0, 0], height / 2 * P[1, 1]
    return Intrinsics(width, height, fx, fy, width / 2 * (1 - P[0, 2]), height / 2 * (1 + P[1, 2]))
