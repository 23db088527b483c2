"""What a refinement leaves behind, as JSON: a camera with its verdict, reasons, iterations and seconds."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from ..cameras.files import camera_to_dict
from ..geometry.camera import Camera
from .report import IterationRecord, RefineReport

VERDICTS = ("trusted", "check", "failed")


def report_to_dict(report: RefineReport) -> dict[str, Any]:
    """The refined camera in the camera format, with "verdict", "reasons", "iterations", "seconds", "quality" and "start"."""
    quality = {name: _number(value) for name, value in asdict(report.quality).items()} if report.quality else None
    return {
        **camera_to_dict(report.camera),
        "verdict": report.verdict,
        "reasons": list(report.reasons),
        "iterations": [_iteration(record) for record in report.iterations],
        "seconds": round(report.seconds, 3),
        "quality": quality,
        "stage": report.stage,
        "lens": report.lens,
        "start": _pose(report.start),
    }


def error_to_dict(start: Camera, sentence: str) -> dict[str, Any]:
    """The record of a photo that could not be tried at all: the start camera, "failed", and the sentence."""
    verdict = {"verdict": "failed", "reasons": [sentence], "iterations": [], "seconds": 0.0, "quality": None}
    return {**camera_to_dict(start), **verdict, "start": _pose(start), "error": sentence}


def _pose(camera: Camera) -> dict[str, Any]:
    return {"R": camera.pose.R.tolist(), "t": camera.pose.t.tolist()}


def _iteration(record: IterationRecord) -> dict[str, Any]:
    return {
        "views_used": record.views_used,
        "matches": record.matches,
        "inliers": record.inliers,
        "epipolar_rms_px": _number(record.epipolar_rms_px),
        "R": record.pose.R.tolist(),
        "t": record.pose.t.tolist(),
    }


def _number(value: float) -> float | None:
    """JSON has no NaN."""
    return value if math.isfinite(value) else None
