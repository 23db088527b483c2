"""What placing by pins comes to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ...geometry.camera import Camera, FloatArray
from .pin import Pin

State = Literal["guided", "placed", "doubtful"]


@dataclass(frozen=True, eq=False)
class PinReport:
    """The camera that the pins place. `state`: "guided" by fewer than three pins, "placed", or "doubtful", and `reasons` say
    why, in whole sentences.

    errors_px (N,): how far each pin lies off, pixels of the photo, infinite behind the camera; counts (N,): how much each
    counts, 0..1 of its weight; median_depth: of the pins, scene units; covariance (15, 15) of xi, T <- exp(xi) T (scene units,
    radians), and of the numbers `lens.NAMES`, solved for or not; translation_std_pct (per cent of the median depth),
    rotation_std_deg and focal_std_pct: the deviations that follow from it, infinite where nothing bounds them.
    """

    camera: Camera
    start: Camera
    state: State
    reasons: tuple[str, ...]
    pins: tuple[Pin, ...]
    errors_px: FloatArray
    counts: FloatArray
    median_depth: float
    covariance: FloatArray
    translation_std_pct: float
    rotation_std_deg: float
    focal_std_pct: float
    solved_focal: bool
    seconds: float
