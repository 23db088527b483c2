"""Pins that a refinement holds: how far they may pull at it, and what is said where the camera leaves them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry.camera import Camera
from ..shared.lens import CameraUnknowns
from .pin import Pin, pin_std_px, pinned_points
from .sentences import left_behind

# A pin that is off by more than so many deviations pulls less and less.
HELD_OUTLIER = 6.0
# Where half of the pins are off by more than so many deviations, the camera is another one than that of the pins.
LEFT = 5.0


def left_pins(pins: Sequence[Pin], camera: Camera) -> str:
    """That `camera`, which was found with the pins held, leaves them, as a sentence; "" where it does not, or there is none."""
    if not pins:
        return ""
    points = pinned_points(pins, camera.intrinsics)
    errors = points.errors_px(CameraUnknowns(camera.pose, camera.intrinsics))
    return left_behind(errors) if np.median(errors) > LEFT * pin_std_px(camera.intrinsics) else ""
