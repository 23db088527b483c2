"""cameras.json, which the training code of INRIA's 3D Gaussian Splatting (and its descendants) leaves beside its splats.

A list of {"id", "img_name", "width", "height", "position": [3], "rotation": 3x3, "fx", "fy"}: the camera's centre, and its axes
(OpenCV's: x right, y down, z forward) as the columns of "rotation", in the world of the splat. The lens is a pinhole whose
centre is the image's.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CameraError, DatasetError
from ..geometry.camera import Intrinsics, Pose
from .files import load_json
from .text import head
from .types import PosedFrame, PoseSet, Split, collect, pose_set

FILE = "cameras.json"
SIGNS = ('"img_name"', '"position"', '"rotation"')
TURN_TOLERANCE = 1e-3  # of the axes' dot products: the file's numbers are float32


def detect(path: Path) -> bool:
    """A file that begins with such a list."""
    start = head(path) if path.is_file() else ""
    return start.lstrip().startswith("[") and all(sign in start for sign in SIGNS)


def read(path: Path, split: Split = "test") -> PoseSet:
    """All cameras of the file, those of test photos first. Raises DatasetError, CameraError."""
    records = load_json(path)
    if not isinstance(records, list):
        raise DatasetError(f"'{path.name}' is no list of cameras; give the cameras.json of a training's output folder.")
    numbered = [(record, f"Camera {number} of '{path.name}'") for number, record in enumerate(records, 1)]
    frames, bad = collect(numbered, lambda one: _frame(*one))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def _frame(record: Any, where: str) -> PosedFrame:
    name = record.get("img_name") if isinstance(record, dict) else None
    if not isinstance(name, str) or not name:
        raise DatasetError(f'{where} lacks "img_name"; take the file from the training\'s output anew.')
    try:
        centre = np.asarray(record["position"], np.float64)
        axes = np.asarray(record["rotation"], np.float64)
        finite = centre.shape == (3,) and axes.shape == (3, 3) and np.isfinite(centre).all() and np.isfinite(axes).all()
        if not finite or np.abs(axes.T @ axes - np.eye(3)).max() > TURN_TOLERANCE or np.linalg.det(axes) < 0:
            raise ValueError
        pose = Pose.from_centre(axes.T, centre)
    except (KeyError, TypeError, ValueError, OverflowError, CameraError):
        raise DatasetError(f'{where} has no "position" and "rotation" of a camera; take the file anew.') from None
    return PosedFrame(name, pose, _lens(record))


def _lens(record: dict[str, Any]) -> Intrinsics | None:
    """The lens where the file tells one; poses can be used without."""
    try:
        width, height, fx, fy = (float(record[name]) for name in ("width", "height", "fx", "fy"))
        return Intrinsics(int(width), int(height), fx, fy, width / 2, height / 2)
    except (KeyError, TypeError, ValueError, OverflowError, CameraError):
        return None
