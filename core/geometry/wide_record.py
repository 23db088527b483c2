"""Lenses that need more than k1 k2 p1 p2 k3, as camera JSON has them.

{"camera_model": "OPENCV_FISHEYE", "width", "height", "fx", "fy", "cx", "cy", "coefficients": {"k1": 0.03, ...}} with the names
of `lens_models`, which are COLMAP's; of a panorama {"camera_model": "EQUIRECTANGULAR", "width", "height"}.
"""

from __future__ import annotations

import math
from typing import Any

from ..errors import CameraError
from .lens_models import EQUIRECTANGULAR, MODELS
from .wide_lens import WideLens

MODEL, COEFFICIENTS = "camera_model", "coefficients"
SIZES, LENGTHS = ("width", "height"), ("fx", "fy", "cx", "cy")
# What says that the lens is an ordinary one, whose "dist" is read.
ORDINARY = ("PINHOLE", "OPENCV")


def to_dict(lens: WideLens) -> dict[str, Any]:
    sizes = {MODEL: lens.model, "width": lens.width, "height": lens.height}
    if lens.is_panorama:
        return sizes
    return {**sizes, **{key: getattr(lens, key) for key in LENGTHS}, COEFFICIENTS: lens.values}


def from_dict(data: Any, name: str) -> WideLens | None:
    """The lens in a record, None where it tells none of these models. Raises CameraError, whose sentence `name` begins."""
    model = data.get(MODEL) if isinstance(data, dict) else None
    if model is None or model in ORDINARY:
        return None
    if model not in MODELS:
        raise CameraError(f"{name} has the camera_model {model!s:.60}; use one of {', '.join((*ORDINARY, *MODELS))}.")
    coefficients = data.get(COEFFICIENTS, {})
    keys = SIZES if model == EQUIRECTANGULAR else (*SIZES, *LENGTHS)
    if not isinstance(coefficients, dict):
        raise CameraError(f'{name} has "{COEFFICIENTS}" that are no names with numbers; correct them.')
    numbers = {key: _number(data, key, name) for key in keys}
    values = tuple((key, _number(coefficients, key, name)) for key in coefficients)
    width, height = (int(numbers[key]) for key in SIZES)
    try:
        if model == EQUIRECTANGULAR:
            return WideLens.panorama(width, height)
        fx, fy, cx, cy = (numbers[key] for key in LENGTHS)
        return WideLens(model, width, height, fx, fy, cx, cy, values)
    except CameraError as error:
        raise CameraError(f"{name} cannot be used: {error}") from None


def _number(data: dict[str, Any], key: str, name: str) -> float:
    value = data.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CameraError(f'{name} has the entry "{key}", which is not a number; correct it.')
    return float(value)
