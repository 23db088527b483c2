"""Our own JSON: camera files, and the results of `refine` and `batch`."""

from __future__ import annotations

from pathlib import Path

from ..errors import DatasetError
from .files import load_json, start_from_dict
from .text import head
from .types import PosedFrame, PoseSet, Split, pose_set
from .unplaced import is_unplaced


def detect(path: Path) -> bool:
    """Whether the file begins as JSON does."""
    return path.is_file() and head(path).lstrip()[:1] in ("{", "[")


def read(path: Path, split: Split = "test") -> PoseSet:
    """All cameras of the file that have an answer: a photo that could not be tried at all (a result with "error") has none,
    nor has one without "R" and "t".

    A result whose verdict is "failed" stands for its start, as it does for the user. Raises DatasetError, CameraError.
    """
    data = load_json(path)
    records = data.get("frames", [data]) if isinstance(data, dict) else data
    if not isinstance(records, list):
        raise DatasetError(f"'{path.name}' has no list of cameras under \"frames\"; give at least one camera there.")
    frames, unsolved = [], 0
    for number, record in enumerate(records, 1):
        if is_unplaced(record):
            unsolved += 1
            continue
        where = f"Camera {number} of '{path.name}'"
        camera = start_from_dict(record, where)
        if not camera.file:
            raise DatasetError(f'{where} names no photo; give it a "file", by which poses are matched.')
        if "error" in record:
            unsolved += 1
            continue
        frames.append(PosedFrame(camera.file, camera.pose, camera.intrinsics, wide=camera.wide))
    return pose_set(path, frames, metric=False, unsolved=unsolved)
