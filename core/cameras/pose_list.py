"""Pose lists: lines `name qw qx qy qz tx ty tz [...]`, world-to-camera; further columns (a focal length) are not read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..errors import DatasetError
from ..geometry.camera import Pose
from ..geometry.quaternion import quaternion_from_rotation
from ..support.atomic import atomic_write
from ..support.words import counted
from .text import POSE_COLUMNS, data_lines, pose_from_columns
from .types import PosedFrame, PoseSet, Split, pose_set, short

COLUMNS = 8


def detect(path: Path) -> bool:
    """Any file may be a pose list: this layout is asked last, and its reader says what is wrong."""
    return path.is_file()


def read(path: Path, split: Split = "test") -> PoseSet:
    """All poses of the list. Raises DatasetError with the line that cannot be used."""
    frames: list[PosedFrame] = []
    for where, columns in data_lines(path):
        if len(columns) < COLUMNS and not frames and path.suffix != ".txt":
            raise DatasetError(
                f"'{path.name}' is in no layout of cameras that is known; a pose list has lines of name {POSE_COLUMNS}."
            )
        if len(columns) < COLUMNS:
            raise DatasetError(f"{where} has {counted(len(columns), 'column')}; it should hold name qw qx qy qz tx ty tz.")
        frames.append(PosedFrame(columns[0], pose_from_columns(columns[1:COLUMNS], where)))
    return pose_set(path, frames, metric=True)


def write(path: Path, poses: Iterable[tuple[str, Pose]]) -> None:
    """Write (name, pose) pairs so that `read` gives the same doubles back; the file appears whole or not at all."""
    lines = [" ".join([checked(name), *pose_columns(pose)]) + "\n" for name, pose in poses]
    with atomic_write(path) as file:
        file.writelines(lines)


def pose_columns(pose: Pose) -> list[str]:
    """qw qx qy qz tx ty tz as text, to the last digit of a double."""
    return [repr(float(value)) for value in (*quaternion_from_rotation(pose.R), *pose.t)]


def checked(name: str) -> str:
    """`name`, fit to be a column. Raises DatasetError when it is empty, has blanks in it, or would read as a comment."""
    if name.split() != [name] or name.startswith("#"):
        raise DatasetError(f"The photo's name '{short(name)}' cannot stand in a pose list; rename it without blanks.")
    return name
