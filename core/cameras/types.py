"""What the readers of data sets hand over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..errors import CameraError, DatasetError
from ..geometry.camera import Intrinsics, Pose
from ..photos.size import size_problem

Split = Literal["test", "train"]
# An error shows so many characters of a name.
LONGEST_NAME = 100


@dataclass(frozen=True)
class PosedFrame:
    """A photo's name as its file spells it, its pose (world-to-camera, the file's own world and unit), and its lens where
    the file tells one that `Intrinsics` can hold.
    """

    name: str
    pose: Pose
    intrinsics: Intrinsics | None = None


@dataclass(frozen=True)
class PoseSet:
    """The poses of one file or folder, in its order. `metric`: the layout's unit is the metre.

    `unsolved` counts the photos that the file lists without an answer of their own.
    """

    source: str
    frames: tuple[PosedFrame, ...]
    metric: bool = True
    unsolved: int = 0

    @property
    def names(self) -> list[str]:
        return [frame.name for frame in self.frames]


@dataclass(frozen=True)
class QueryPhoto:
    """A photo to be placed: its name inside the data set, its file, and its lens."""

    name: str
    photo: Path
    intrinsics: Intrinsics


def lens_of_file(lens: Intrinsics) -> Intrinsics:
    """The lens that a camera file tells, as it is: every reader asks this. Raises CameraError where no photo has its size."""
    problem = size_problem(lens.width, lens.height)
    if problem:
        raise CameraError(f"The camera's image is {lens.width} x {lens.height} pixels; {problem}, so correct its size.")
    return lens


def short(name: str) -> str:
    """A name out of a file, fit to stand in a sentence: on one line, and cut where a damaged file made it endless."""
    line = " ".join(name.split())
    return line if len(line) <= LONGEST_NAME else line[: LONGEST_NAME - 3] + "..."


def pose_set(path: Path, frames: Sequence[PosedFrame], metric: bool, unsolved: int = 0) -> PoseSet:
    """A PoseSet named after `path`. Raises DatasetError when it is empty or holds a name twice."""
    if not frames and not unsolved:
        raise DatasetError(f"'{path}' holds no poses; give the file or folder that has them.")
    seen: set[str] = set()
    for frame in frames:
        if frame.name in seen:
            raise DatasetError(f"'{path.name}' holds '{short(frame.name)}' more than once; leave one pose for each photo.")
        seen.add(frame.name)
    return PoseSet(path.name or str(path), tuple(frames), metric, unsolved)
