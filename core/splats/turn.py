"""A scene turned by half a turn about an axis, exactly; and so between the axes of two formats, y down (PLY) and y up (SPZ)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ..errors import SplatFormatError
from ..geometry import conventions
from ..geometry.conventions import Orientation
from .scene import GaussianScene

TURNS = {
    "x": (conventions.HALF_TURN_X, conventions.HALF_TURN_X_QUATERNION, conventions.HALF_TURN_X_SH),
    "y": (conventions.HALF_TURN_Y, conventions.HALF_TURN_Y_QUATERNION, conventions.HALF_TURN_Y_SH),
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
