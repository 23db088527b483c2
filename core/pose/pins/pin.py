"""A pin: a pixel of the photo, and the point of the scan that the photo shows there; and files of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...cameras.files import load_json
from ...errors import CameraError
from ...geometry.camera import FloatArray, Intrinsics
from ..final.pinned import PinnedPoints

# Pixels of a photo that is shown this large along its long side are hit by hand to CLICK_PX: three pixels at most, evenly
# spread over that circle, are 1.5 px in each direction. A larger photo is shown smaller.
SHOWN_LONG_SIDE_PX = 1280
CLICK_PX = 1.5
# A pin takes two clicks, one in the photo and one on the scan.
PIN_PX = CLICK_PX * 2**0.5
# A pin that is off by more than so many deviations soon counts for nothing, where there are enough others.
OUTLIER = 4.0
MAX_WEIGHT = 1e6


@dataclass(frozen=True)
class Pin:
    """`photo`: a pixel (x, y) of the photo at its full size, distorted as the lens drew it; `world`: the point (x, y, z) of the
    scan that is to be seen there, in its coordinates; `weight`: how many clicks by hand it counts as.

    Raises CameraError for numbers that are none.
    """

    photo: tuple[float, float]
    world: tuple[float, float, float]
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not np.isfinite((*self.photo, *self.world)).all():
            raise CameraError("A pin holds a number that is not finite; set it again.")
        if not 0 < self.weight <= MAX_WEIGHT:
            raise CameraError(f"The weight of a pin is {self.weight:g}; give one above 0 and up to {MAX_WEIGHT:g}.")

    def relative_to(self, origin: Sequence[float]) -> Pin:
        """The same pin among points of which `origin` was subtracted."""
        x, y, z = (value - shift for value, shift in zip(self.world, origin, strict=True))
        return Pin(self.photo, (x, y, z), self.weight)


@dataclass(frozen=True)
class ViewPin:
    """A pin whose point is told by where the scan is seen: the pixel `view` of the scan drawn through the start camera, without
    distortion, at the photo's size.
    """

    photo: tuple[float, float]
    view: tuple[float, float]
    weight: float = 1.0


def pin_std_px(lens: Intrinsics) -> float:
    """The standard deviation of a pin's pixel in each direction, in pixels of the photo of `lens`."""
    return PIN_PX * max(1.0, max(lens.width, lens.height) / SHOWN_LONG_SIDE_PX)


def pinned_points(pins: Sequence[Pin], lens: Intrinsics, scale: float = np.inf) -> PinnedPoints:
    """The pins as residuals in the photo of `lens`; `scale` as in PinnedPoints."""
    weights = np.array([pin.weight for pin in pins])
    return PinnedPoints.of(worlds(pins), photos(pins), pin_std_px(lens), weights, scale)


def worlds(pins: Sequence[Pin]) -> FloatArray:
    """The points of the pins (N, 3)."""
    return np.array([pin.world for pin in pins], np.float64).reshape(-1, 3)


def photos(pins: Sequence[Pin]) -> FloatArray:
    """The pixels of the pins (N, 2)."""
    return np.array([pin.photo for pin in pins], np.float64).reshape(-1, 2)


def read_pins(path: Path) -> list[Pin | ViewPin]:
    """The pins of a file: {"pins": [{"photo": [x, y], "world": [x, y, z], "weight": 1}, ...]}, or with "view": [x, y] in place
    of "world"; a result that holds its pins serves as well. Raises CameraError.
    """
    data = load_json(path)
    records = data.get("pins") if isinstance(data, dict) else data
    if not isinstance(records, list) or not records:
        raise CameraError(f"'{path.name}' has no list of pins under \"pins\"; give at least three there.")
    return [_pin(record, f"Pin {number} of '{path.name}'") for number, record in enumerate(records, 1)]


def pin_to_dict(pin: Pin) -> dict[str, Any]:
    """The pin as JSON holds it."""
    return {"photo": list(pin.photo), "world": list(pin.world), "weight": pin.weight}


def _pin(record: Any, name: str) -> Pin | ViewPin:
    if not isinstance(record, dict):
        raise CameraError(f'{name} is no record; give {{"photo": [x, y], "world": [x, y, z]}}.')
    x, y = _numbers(record, "photo", 2, name)
    weight = record.get("weight", 1.0)
    if isinstance(weight, bool) or not isinstance(weight, int | float):
        raise CameraError(f"The weight of {name[:1].lower()}{name[1:]} is no number; give one above 0, or leave it out.")
    if "world" in record:
        wx, wy, wz = _numbers(record, "world", 3, name)
        return Pin((x, y), (wx, wy, wz), float(weight))
    if "view" not in record:
        raise CameraError(f'{name} has neither "world" nor "view"; give the point of the scan, or its pixel in a view of it.')
    u, v = _numbers(record, "view", 2, name)
    return ViewPin((x, y), (u, v), float(weight))


def _numbers(record: dict[str, Any], key: str, count: int, name: str) -> list[float]:
    """Raises CameraError when there are not as many finite numbers."""
    values = record.get(key)
    good = isinstance(values, list) and len(values) == count
    if not good or not all(isinstance(v, int | float) and not isinstance(v, bool) and np.isfinite(v) for v in values or ()):
        raise CameraError(f'{name} has no "{key}" of {count} finite numbers; give them.')
    return [float(value) for value in values or ()]
