"""Pins on the command line: read, put on the scan, and the camera that they place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..batch.place import starts_in_scene
from ..cameras.files import camera_to_dict
from ..cameras.training_world import Axes, ScanAxes
from ..cameras.unplaced import Unplaced
from ..errors import UsageError
from ..geometry.camera import Camera, Pose
from ..geometry.pinhole_cut import WideCamera
from ..photos.fit import fit_camera
from ..photos.photo import Photo
from ..pose.pins.lift import lifted_pins
from ..pose.pins.pin import Pin, pin_to_dict, read_pins
from ..pose.pins.place import FOCAL_PINS, LEAST, PinLens, PinOptions, look_at_pins, place_by_pins
from ..pose.pins.report import PinReport
from ..pose.report_json import pose_to_dict
from ..render.view import ViewRenderer
from ..splats import GaussianScene

PINNED = "pinned"  # the verdict of a camera that pins alone place


class Pinning:
    """Places photos in one scan by pins from files, in the coordinates of the scene."""

    def __init__(self, renderer: ViewRenderer, scene: GaussianScene, axes: Axes) -> None:
        """`axes`: those of a start camera; the points of pins are always in the coordinates of the scan's file."""
        self._renderer, self._scene, self._axes = renderer, scene, axes

    def place(self, photo: Photo, wanted: Camera | Unplaced, file: Path, lens: PinLens) -> PinReport:
        """The camera that the pins of a file place, near the start where there is one. Raises GssmcError."""
        start = None if isinstance(wanted, Unplaced) else self._start(photo, wanted)
        pins = lifted_pins(self._renderer, start, self._in_scene(read_pins(file)))
        needed = LEAST if start else FOCAL_PINS
        if len(pins) < needed:
            why = "" if start else " without a start, for three leave several cameras"
            raise UsageError(f"'{file.name}' holds {len(pins)} pins; give at least {needed}{why}.")
        options = PinOptions(lens, photo.focal_35mm, start_known=start is not None)
        if start is None:
            assert isinstance(wanted, Unplaced)
            start = self._looking(photo, wanted, pins)
        return place_by_pins(start, pins, options)

    def _start(self, photo: Photo, wanted: Camera) -> Camera:
        found, _ = starts_in_scene(wanted, ScanAxes.of(self._scene), self._axes, self._scene.origin)[0]
        return fit_camera(photo, found)

    def _looking(self, photo: Photo, wanted: Unplaced, pins: list[Pin]) -> Camera:
        """A camera that has the pins before it, with the lens of `wanted`."""
        if wanted.wide is not None:
            return fit_camera(photo, WideCamera.of(wanted.wide, Pose()))
        assert wanted.intrinsics is not None, "a photo gives a lens where no file does"
        lens = Camera(wanted.intrinsics, Pose(), wanted.file, wanted.focal_guessed, wanted.pixel_order)
        fitted = fit_camera(photo, lens)
        return Camera(fitted.intrinsics, look_at_pins(pins), fitted.file, fitted.focal_guessed)

    def _in_scene(self, pins: list[Any]) -> list[Any]:
        return [pin.relative_to(self._scene.origin) if isinstance(pin, Pin) else pin for pin in pins]


def pins_to_dict(report: PinReport) -> dict[str, Any]:
    """The camera in the camera format, with "verdict": "pinned", "state", "reasons", "pins" and how sure it is; in the scene's
    coordinates.
    """
    off = zip(report.pins, report.errors_px, report.counts, strict=True)
    pins = [{**pin_to_dict(pin), "error_px": finite(e), "counts": round(float(c), 4)} for pin, e, c in off]
    sure = {name: finite(getattr(report, name)) for name in ("translation_std_pct", "rotation_std_deg", "focal_std_pct")}
    return {
        **camera_to_dict(report.camera),
        "verdict": PINNED,
        "state": report.state,
        "reasons": list(report.reasons),
        "details": [],
        "iterations": [],
        "seconds": round(report.seconds, 3),
        "quality": None,
        "median_depth": report.median_depth,
        **sure,
        "pins": pins,
        "start": pose_to_dict(report.start.pose),
    }


def pins_into_file(record: dict[str, Any], origin: Sequence[float]) -> dict[str, Any]:
    """A record whose pins stand in the scene's coordinates, with those of the scan's file."""
    pins = [{**pin, "world": [x + o for x, o in zip(pin["world"], origin, strict=True)]} for pin in record["pins"]]
    return {**record, "pins": pins}


def finite(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return float(value) if abs(value) < float("inf") else None
