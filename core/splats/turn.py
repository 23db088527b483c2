"""A scene turned by half a turn about an axis, exactly; and so between the axes of two formats, y down (PLY) and y up (SPZ)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ..errors import SplatFormatError
from ..geometry.conventions import HALF_TURN_X, HALF_TURN_X_QUATERNION, HALF_TURN_X_SH, Orientation
from .scene import GaussianScene

# Factors of positions, quaternions and SH coefficients. That about y takes axes of x right, z back to x left, z front.
TURNS = {
    "x": (HALF_TURN_X, HALF_TURN_X_QUATERNION, HALF_TURN_X_SH),
    "y": (
        np.array([-1.0, 1.0, -1.0]),
        np.array([1.0, -1.0, 1.0, -1.0]),
        np.array([1.0, 1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1]),
    ),
}


def turned(scene: GaussianScene, orientation: Orientation) -> GaussianScene:
    """`scene` with axes that point as `orientation` says: itself, or turned by 180 degrees about x.

    Raises SplatFormatError for scenes with z up or down, which no format here writes.
    """
    if scene.orientation == orientation:
        return scene
    if {scene.orientation, orientation} != {"Y_DOWN", "Y_UP"}:
        raise SplatFormatError(f"The scan's axes are {scene.orientation}; only scans with y up or y down can be written so.")
    return replace(half_turned(scene, "x"), orientation=orientation)


def half_turned(scene: GaussianScene, axis: Literal["x", "y"], reuse: bool = False) -> GaussianScene:
    """`scene` turned by 180 degrees about an axis; which way it is said to point stays. `reuse`: its arrays are taken over, and
    `scene` is not to be used afterwards.
    """
    means, rotations, sh = (signs.astype(np.float32) for signs in TURNS[axis])
    x, y, z = (float(sign) * value + 0.0 for sign, value in zip(means, scene.origin, strict=True))
    return replace(
        scene,
        means=np.multiply(scene.means, means, out=scene.means if reuse else None),
        rotations=np.multiply(scene.rotations, rotations, out=scene.rotations if reuse else None),
        sh=np.multiply(scene.sh, sh[: scene.sh.shape[1], None], out=scene.sh if reuse else None),
        origin=(x, y, z),
    )
