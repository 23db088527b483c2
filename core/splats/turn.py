"""A scene between the axes of two formats: y down (PLY) and y up (SPZ)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import SplatFormatError
from ..geometry.conventions import HALF_TURN_X, HALF_TURN_X_QUATERNION, HALF_TURN_X_SH, Orientation
from .scene import GaussianScene


def turned(scene: GaussianScene, orientation: Orientation) -> GaussianScene:
    """`scene` with axes that point as `orientation` says: itself, or turned by 180 degrees about x.

    Raises SplatFormatError for scenes with z up or down, which no format here writes.
    """
    if scene.orientation == orientation:
        return scene
    if {scene.orientation, orientation} != {"Y_DOWN", "Y_UP"}:
        raise SplatFormatError(f"The scan's axes are {scene.orientation}; only scans with y up or y down can be written so.")
    return replace(
        scene,
        means=scene.means * HALF_TURN_X.astype(np.float32),
        rotations=scene.rotations * HALF_TURN_X_QUATERNION.astype(np.float32),
        sh=scene.sh * HALF_TURN_X_SH[: scene.sh.shape[1], None].astype(np.float32),
        orientation=orientation,
        origin=(scene.origin[0], -scene.origin[1], -scene.origin[2]),
    )
