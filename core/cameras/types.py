"""What the readers of data sets hand over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

from ..errors import CameraError, DatasetError
from ..geometry.camera import Intrinsics, PixelOrder, Pose
from ..geometry.wide_lens import WideLens
from ..photos.size import size_problem
from ..support.words import counted

Split = Literal["test", "train"]
# The lens of a photo of (width, height) pixels as stored. Raises CameraError.
LensOfSize = Callable[[int, int], Intrinsics | WideLens]
T = TypeVar("T")
# An error shows so many characters of a name.
LONGEST_NAME = 100


@dataclass(frozen=True)
class PosedFrame:
    """A photo's name as its file spells it, its pose (world-to-camera, the file's own world and unit), and its lens where
    the file tells one: `intrinsics`, or `wide` for what those cannot hold.

    `lens_of_size`: the lens where the file does not tell the photo's size. `problem`: why there is no lens, or what is wrong
    with it, as part of a sentence; `is_picture`: False for a picture that is not seen from one point. `focal_guessed` as in
    Camera.
    """

    name: str
    pose: Pose
    intrinsics: Intrinsics | None = None
    lens_of_size: LensOfSize | None = None
    problem: str = ""
    is_picture: bool = True
    focal_guessed: bool = False
    wide: WideLens | None = None


@dataclass(frozen=True)
class PoseSet:
    """The poses of one file or folder, in its order. `metric`: the layout's unit is the metre.

    `unsolved` counts the photos that the file lists without an answer of their own. `pixel_order`: whether the layout's
    programs turn photos as EXIF says before they place them (`Camera`). `bad`: a sentence for each record that cannot be used.
    """

    source: str
    frames: tuple[PosedFrame, ...]
    metric: bool = True
    unsolved: int = 0
    pixel_order: PixelOrder = "upright"
    bad: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what of the file is left out."""
        said = Counter(frame.problem for frame in self.frames if frame.problem)
        notes = [f"{counted(count, 'camera')} of '{self.source}': {problem}." for problem, count in said.items()]
        return (*notes, *bad_note(self.bad, self.source))

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


def bad_note(bad: Sequence[str], source: str) -> tuple[str, ...]:
    """What is said of records that cannot be used, of which `bad` tells why."""
    return (f"{counted(len(bad), 'camera')} of '{source}' cannot be used and left out: {bad[0]}",) if bad else ()


def short(name: str) -> str:
    """A name out of a file, fit to stand in a sentence: on one line, and cut where a damaged file made it endless."""
    line = " ".join(name.split())
    return line if len(line) <= LONGEST_NAME else line[: LONGEST_NAME - 3] + "..."


def collect(records: Iterable[T], frame_of: Callable[[T], PosedFrame | None]) -> tuple[list[PosedFrame], tuple[str, ...]]:
    """The frames of a file's records, and a sentence for each record of which none can be made. `frame_of` gives None for one
    that tells no pose.
    """
    frames, bad = [], []
    for record in records:
        try:
            found = frame_of(record)
            frames += [] if found is None else [found]
        except (DatasetError, CameraError) as error:
            bad.append(str(error))
    return frames, tuple(bad)


def pose_set(path: Path, frames: Sequence[PosedFrame], metric: bool, unsolved: int = 0, bad: tuple[str, ...] = ()) -> PoseSet:
    """A PoseSet named after `path`. Raises DatasetError when it is empty or holds a name twice."""
    if not frames and bad:
        raise DatasetError(bad[0])
    if not frames and not unsolved:
        raise DatasetError(f"'{path}' holds no poses; give the file or folder that has them.")
    seen: set[str] = set()
    for frame in frames:
        if frame.name in seen:
            raise DatasetError(f"'{path.name}' holds '{short(frame.name)}' more than once; leave one pose for each photo.")
        seen.add(frame.name)
    return PoseSet(path.name or str(path), tuple(frames), metric, unsolved, bad=bad)
