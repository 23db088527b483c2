"""RealityCapture's (RealityScan's) internal and external camera parameters as CSV: a place, three angles, and a lens a line.

heading (yaw), pitch and roll (degrees) turn about z, x and y, the heading clockwise; the camera looks along its own -z with y
up, as nerfstudio reads these files. f is in mm on film of 36 mm across the photo's long side; px, py are shares of that side.
The program's own templates say so: this table has $(f*36) and $(px) under the names f_35mm and px_norm, and the one for OpenCV
has $(f*scale) and $(px*scale+width*0.5). It also puts t2 and t1 where OpenCV has p1 and p2.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import DatasetError
from ...geometry.camera import FloatArray
from ...geometry.conventions import FLIP_YZ
from ...geometry.foreign_lens import BROWN
from ..text import read_lines
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, lens_by_size, pose_of, without_lens

FILM_MM = 36.0
NAME, PLACE, ANGLES = "#name", ("x", "y", "alt"), ("heading", "pitch", "roll")
NAMES_SINCE_2 = {"yaw": "heading", "f_35mm": "f", "px_norm": "px", "py_norm": "py"}
LENS = ("f", "px", "py", "k1", "k2", "k3", "k4", "t1", "t2")


def detect(path: Path) -> bool:
    """A table whose first line names the columns."""
    columns = _columns(begins(path).split("\n", 1)[0].split(","))
    return columns[0] == NAME and all(name in columns for name in ANGLES)


def read(path: Path, split: Split = "test") -> PoseSet:
    """All cameras of the table. Raises DatasetError."""
    lines = [(number, line) for number, line in read_lines(path) if line.strip()]
    columns = _columns(next(csv.reader([lines[0][1]])))
    rows = [
        (f"Line {number} of '{path.name}'", dict(zip(columns, values, strict=False)))
        for number, line in lines[1:]
        for values in csv.reader([line])
    ]
    frames, bad = collect(rows, lambda row: _frame(*row))
    return replace(pose_set(path, frames, metric=False, bad=bad))


def _columns(names: Sequence[str]) -> list[str]:
    """The names of the columns, as the older versions have them."""
    plain = [name.strip().lower() for name in names]
    return [NAMES_SINCE_2.get(name, name) for name in plain]


def _frame(where: str, row: Mapping[str, str]) -> PosedFrame:
    name = row.get(NAME, "").strip()
    try:
        centre, angles = (finite([row[key] for key in keys], 3) for keys in (PLACE, ANGLES))
    except FAULTS:
        raise DatasetError(f"{where} has no place and angles of a camera; export the table again.") from None
    if not name:
        raise DatasetError(f"{where} names no photo; export the table again.")
    pose = pose_of(where, (_axes(*angles) @ FLIP_YZ).T, centre)
    if "f" not in row:
        return PosedFrame(name, pose)
    try:
        f, px, py, k1, k2, k3, k4, t1, t2 = finite([row.get(key) or 0 for key in LENS], len(LENS)).tolist()
    except FAULTS:
        return without_lens(name, pose)
    values = {"cx": px, "cy": py, "k1": k1, "k2": k2, "k3": k3, "k4": k4, "p1": t2, "p2": t1}
    return PosedFrame(name, pose, lens_of_size=lens_by_size(BROWN, f / FILM_MM, values, of_long_side=True))


def _axes(heading: float, pitch: float, roll: float) -> FloatArray:
    """The camera's own axes, right, up and back, as columns."""
    (sz, cz), (sx, cx), (sy, cy) = ((math.sin(angle), math.cos(angle)) for angle in map(math.radians, (-heading, pitch, roll)))
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return np.asarray(about_z @ about_x @ about_y)
