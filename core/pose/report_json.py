"""What a refinement leaves behind, as JSON: a camera with its verdict, reasons, iterations and seconds."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from ..cameras.files import StartCamera, camera_to_dict
from ..cameras.unplaced import Unplaced, wanted_to_dict
from ..geometry.camera import Camera, Pose
from .report import IterationRecord, PoseQuality, RefineReport

VERDICTS = ("trusted", "check", "failed")


def report_to_dict(report: RefineReport) -> dict[str, Any]:
    """The camera in the camera format, with "verdict", "reasons", "details", "iterations", "seconds", "quality" and "start"."""
    return {
        **camera_to_dict(report.camera),
        "verdict": report.verdict,
        "reasons": list(report.reasons),
        "details": list(report.details),
        "iterations": [_iteration(record) for record in report.iterations],
        "seconds": round(report.seconds, 3),
        "quality": quality_to_dict(report.quality) if report.quality else None,
        "stage": report.stage,
        "lens": report.lens,
        "start": pose_to_dict(report.start.pose),
    }


def error_to_dict(start: Camera | StartCamera | Unplaced, sentence: str) -> dict[str, Any]:
    """The record of a photo that could not be tried at all: the start camera, "failed", and the sentence."""
    return {**failed_to_dict(start, sentence), "error": sentence}


def failed_to_dict(start: Camera | StartCamera | Unplaced, sentence: str) -> dict[str, Any]:
    """The record of a photo for which no pose was found: the start camera, without a pose where it had none."""
    verdict = {"verdict": "failed", "reasons": [sentence], "details": [], "iterations": [], "seconds": 0.0, "quality": None}
    return {**wanted_to_dict(start), **verdict, "start": None if isinstance(start, Unplaced) else pose_to_dict(start.pose)}


def pose_to_dict(pose: Pose) -> dict[str, Any]:
    return {"R": pose.R.tolist(), "t": pose.t.tolist()}


def quality_to_dict(quality: PoseQuality) -> dict[str, Any]:
    """The evidence; "of" says of which pose, which "pose" holds."""
    values = {field.name: getattr(quality, field.name) for field in fields(quality)}
    return {name: _value(value) for name, value in values.items()}


def _value(value: Any) -> Any:
    if isinstance(value, Pose):
        return pose_to_dict(value)
    return _number(value) if isinstance(value, float) else value


def _iteration(record: IterationRecord) -> dict[str, Any]:
    return {
        "views_used": record.views_used,
        "matches": record.matches,
        "inliers": record.inliers,
        "rms_px_of_photo": _number(record.rms_px_of_photo),
        **pose_to_dict(record.pose),
    }


def _number(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return value if math.isfinite(value) else None
