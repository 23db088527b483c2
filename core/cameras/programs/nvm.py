"""VisualSFM's .nvm, version 3, of its first model: name, focal length (pixels), quaternion w x y z, centre, distortion r.

World-to-camera, OpenCV's axes. The distortion is the other way round than elsewhere: an undistorted point is d (1 + r |d|^2).
The photos are those that are stored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ...errors import CameraError, DatasetError
from ...geometry.quaternion import rotation_from_quaternion
from ..text import data_lines
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, lens_by_size, pose_of

SIGN = "NVM_V3"
NUMBERS = 9


def detect(path: Path) -> bool:
    return begins(path).startswith(SIGN)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The cameras of the file's first model. Raises DatasetError."""
    lines = (line for line in data_lines(path) if not line[1][0].startswith(SIGN))
    try:
        count = int(next(lines)[1][0])
        rows = [next(lines) for _ in range(count)]
    except (StopIteration, ValueError, RuntimeError):
        raise DatasetError(f"'{path.name}' ends before the cameras that it promises; export it again.") from None
    frames, bad = collect(rows, lambda row: _frame(*row))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def _frame(where: str, columns: Sequence[str]) -> PosedFrame:
    try:
        # A name may hold blanks; ten columns follow it.
        name = " ".join(columns[: len(columns) - NUMBERS - 1])
        values = finite(columns[len(columns) - NUMBERS - 1 : -1], NUMBERS)
        rotation = rotation_from_quaternion(values[1:5].tolist())
    except (*FAULTS, CameraError):
        raise DatasetError(f"{where} is no camera; it should hold a name and 10 numbers.") from None
    if not name:
        raise DatasetError(f"{where} names no photo; export the file again.")
    pose = pose_of(where, rotation, values[5:8])
    lens = lens_by_size("INVERSE_RADIAL", float(values[0]), {"r": float(values[8])})
    return PosedFrame(name, pose, lens_of_size=lens)
