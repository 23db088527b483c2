"""Bundler's bundle.out, with the photos' names in the list.txt beside it, as Bundler's manual describes them.

World-to-camera, the camera looks along -z with y up; one focal length in pixels, k1 and k2, the centre in the photo's middle.
The photos are those that are stored.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import DatasetError
from ...geometry.conventions import FLIP_YZ
from ...geometry.foreign_lens import BROWN
from ..text import data_lines
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, lens_by_size, pose_of

SIGN = "# Bundle file"
LINES = 5  # of a camera: focal length and distortion, three rows of the rotation, translation


def detect(path: Path) -> bool:
    return begins(path).startswith(SIGN)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The cameras that were placed. Raises DatasetError."""
    lines = data_lines(path)
    try:
        count = int(next(lines)[1][0])
        rows = [next(lines) for _ in range(LINES * count)]
    except (StopIteration, ValueError, RuntimeError):
        raise DatasetError(f"'{path.name}' ends before the cameras that it promises; export it again.") from None
    names = _names(path)
    if len(names) < count:
        raise DatasetError(f"'{path.name}' names no photos; put its list.txt, with {count} names, beside it.")
    cameras = [(names[i], rows[LINES * i : LINES * (i + 1)]) for i in range(count)]
    placed = [camera for camera in cameras if camera[1][0][1][0].strip("0.+-eE")]
    frames, bad = collect(placed, lambda camera: _frame(*camera))
    found = pose_set(path, frames, metric=False, unsolved=count - len(placed), bad=bad)
    return replace(found, pixel_order="stored")


def _names(path: Path) -> list[str]:
    for file in (path.with_name("list.txt"), path.with_suffix(".list.txt"), path.with_name(f"{path.name}.list.txt")):
        if file.is_file():
            return [columns[0] for _, columns in data_lines(file)]
    return []


def _frame(name: str, rows: list[tuple[str, list[str]]]) -> PosedFrame:
    where = rows[0][0]
    try:
        (focal, k1, k2), *rotation, shift = (finite(columns, 3) for _, columns in rows)
    except FAULTS:
        raise DatasetError(f"{where} does not begin a camera of {LINES} lines of 3 numbers; export the file again.") from None
    R = np.stack(rotation)
    pose = pose_of(where, FLIP_YZ @ R, -R.T @ shift)
    values = {"k1": float(k1), "k2": float(k2)}
    return PosedFrame(name, pose, lens_of_size=lens_by_size(BROWN, float(focal), values))
