"""What a refinement leaves behind, as JSON: a camera with its verdict, reasons, iterations and seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from ..cameras.files import StartCamera, camera_to_dict
from ..cameras.unplaced import Unplaced, wanted_to_dict
from ..errors import CameraError
from ..geometry.camera import Camera, Intrinsics, Pose
from .report import LENS_NUMBERS, IterationRecord, LensEvidence, LensNumber, PoseQuality, RefineReport

# Six of the pose, and those of the lens.
LENS_UNKNOWNS = 6 + len(LENS_NUMBERS)
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
        "lens_evidence": None if report.lens_evidence is None else _evidence(report.lens_evidence),
        "stage": report.stage,
        "lens": lens_to_dict(report.lens),
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


def quality_from_dict(data: Any) -> PoseQuality:
    """The evidence as `quality_to_dict` wrote it; what JSON could not hold is NaN. Raises KeyError, TypeError or ValueError, or
    CameraError, when it is something else.
    """
    pose = Pose(np.array(data["pose"]["R"], np.float64), np.array(data["pose"]["t"], np.float64))
    data = {"lens_focal_pct": None} | data  # earlier versions did not write it
    values: dict[str, Any] = {f.name: math.nan if data[f.name] is None else data[f.name] for f in fields(PoseQuality)}
    return PoseQuality(**(values | {"pose": pose}))


def lens_to_dict(numbers: Sequence[LensNumber]) -> dict[str, Any]:
    return {n.name: {"state": n.state, "value": n.value, "std": _number(n.std)} for n in numbers}


def lens_from_dict(data: Any) -> tuple[LensNumber, ...]:
    """The numbers of a lens as `lens_to_dict` wrote them. Raises KeyError, TypeError or ValueError for anything else."""
    numbers = [(name, data[name]) for name in LENS_NUMBERS]
    return tuple(
        LensNumber(name, n["state"], float(n["value"]), math.inf if n["std"] is None else float(n["std"]))
        for name, n in numbers
    )


def _evidence(known: LensEvidence) -> dict[str, Any]:
    """What is known of the lens: the upper triangle of the information, row by row, and the guess as a list of numbers."""
    k = known.guess
    rows = known.information[np.triu_indices(len(known.information))]
    return {
        "information": rows.tolist(),
        "guess": [k.width, k.height, k.fx, k.fy, k.cx, k.cy, *k.dist],
        "focal_std": known.focal_std,
    }


def evidence_from_dict(data: Any) -> LensEvidence | None:
    """The evidence that a record holds; None where it holds none that can be used."""
    try:
        rows, guess = np.array(data["information"], np.float64), [float(number) for number in data["guess"]]
        focal_std = float(data["focal_std"])
        information = np.zeros((LENS_UNKNOWNS, LENS_UNKNOWNS))
        information[np.triu_indices(LENS_UNKNOWNS)] = rows
        width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3 = guess
        k = Intrinsics(int(width), int(height), fx, fy, cx, cy, (k1, k2, p1, p2, k3))
    except (TypeError, KeyError, ValueError, IndexError, CameraError):
        return None
    usable = np.isfinite(information).all() and focal_std > 0
    return LensEvidence(information + np.triu(information, 1).T, k, focal_std) if usable else None


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
