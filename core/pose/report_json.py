"""What a refinement leaves behind, as JSON: a camera with its verdict, reasons, iterations and seconds."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

from ..cameras.files import camera_to_dict
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
        "start": _pose(report.start.pose),
    }


def error_to_dict(start: Camera, sentence: str) -> dict[str, Any]:
    """The record of a photo that could not be tried at all: the start camera, "failed", and the sentence."""
    verdict = {"verdict": "failed", "reasons": [sentence], "details": [], "iterations": [], "seconds": 0.0, "quality": None}
    return {**camera_to_dict(start), **verdict, "start": _pose(start.pose), "error": sentence}


def _pose(pose: Pose) -> dict[str, Any]:
    return {"R": pose.R.tolist(), "t": pose.t.tolist()}


def quality_to_dict(quality: PoseQuality) -> dict[str, Any]:
    """The evidence; "of" says of which pose, which "pose" holds."""
    values = {field.name: getattr(quality, field.name) for field in fields(quality)}
    return {name: _value(value) for name, value in values.items()}


def _value(value: Any) -> Any:
    if isinstance(value, Pose):
        return _pose(value)
    return _number(value) if isinstance(value, float) else value


def _iteration(record: IterationRecord) -> dict[str, Any]:
    return {
        "views_used": record.views_used,
        "matches": record.matches,
        "inliers": record.inliers,
        "rms_px_of_photo": _number(record.rms_px_of_photo),
        **_pose(record.pose),
    }


def _number(value: float) -> float | None:
    """JSON has neither NaN nor infinity."""
    return value if math.isfinite(value) else None
