"""7-Scenes folders: TrainSplit.txt / TestSplit.txt, and seq-NN/frame-NNNNNN.{color.png,pose.txt}; camera-to-world, metres.

The poses are read as published: those of the depth camera's tracking, which the data set's own evaluation takes for the photos.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import CameraError, DatasetError
from ..geometry.camera import Intrinsics, Pose
from .text import data_lines, numbers
from .types import PosedFrame, PoseSet, QueryPhoto, Split, pose_set

SPLIT_FILES: dict[Split, str] = {"test": "TestSplit.txt", "train": "TrainSplit.txt"}
SEQUENCE = re.compile(r"seq(?:uence)?[-_]?0*([0-9]{1,6})", re.IGNORECASE)
PHOTOS = "*.color.*"
POSES = "*.pose.txt"
WIDTH, HEIGHT = 640, 480
FOCAL = 525.0  # of the colour camera, as published evaluations take it (585 is the depth camera's)
MAX_POSE_VALUES = 16


def detect(path: Path) -> bool:
    """A scene folder, or a single sequence."""
    if not path.is_dir():
        return False
    folders = [path, *_all_sequences(path).values()]
    return any((path / name).is_file() for name in SPLIT_FILES.values()) or any(any(f.glob(POSES)) for f in folders)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The poses of the split's sequences (of all of them where there is no split file). Raises DatasetError."""
    frames = []
    for folder in sequences(path, split):
        for file in sorted(folder.glob(POSES)):
            photo = file.with_name(file.name.removesuffix(".pose.txt") + ".color.png")
            frames.append(PosedFrame(_name(photo, path), _read_pose(file)))
    return pose_set(path, frames, metric=True)


def queries(path: Path, focal: float | None = None) -> list[QueryPhoto]:
    """The photos of the test split, with the data set's lens or the focal length given (pixels at 640 x 480)."""
    lens = Intrinsics(WIDTH, HEIGHT, focal or FOCAL, focal or FOCAL, WIDTH / 2, HEIGHT / 2)
    photos = [photo for folder in sequences(path, "test") for photo in sorted(folder.glob(PHOTOS))]
    if not photos:
        raise DatasetError(f"'{path.name}' has no frame-*.color.png in its test sequences; unpack its seq-*.zip first.")
    return [QueryPhoto(_name(photo, path), photo, lens) for photo in photos]


def sequences(path: Path, split: Split) -> list[Path]:
    """The folders of a split, in its order; all where there is no split file; `path` itself when it is a sequence."""
    listed = path / SPLIT_FILES[split]
    folders = _all_sequences(path)
    if not listed.is_file():
        return [folders[number] for number in sorted(folders)] or [path]
    found = []
    for where, columns in data_lines(listed):
        match = SEQUENCE.fullmatch("".join(columns))
        if match is None:
            raise DatasetError(f"{where} names no sequence; it should read as 'sequence1' does.")
        if int(match[1]) not in folders:
            raise DatasetError(f"{where} lists sequence {match[1]}, whose folder is missing; unpack its seq-*.zip first.")
        found.append(folders[int(match[1])])
    return found


def _all_sequences(path: Path) -> dict[int, Path]:
    matches = {folder: SEQUENCE.fullmatch(folder.name) for folder in path.iterdir() if folder.is_dir()}
    return {int(match[1]): folder for folder, match in matches.items() if match}


def _name(photo: Path, root: Path) -> str:
    """The photo's name in the data set: with its sequence's folder, also when the sequence itself was given."""
    if photo.parent == root and SEQUENCE.fullmatch(root.name):
        return f"{root.name}/{photo.name}"
    return photo.relative_to(root).as_posix()


def _read_pose(file: Path) -> Pose:
    where = f"'{file.parent.name}/{file.name}'"
    columns: list[str] = []
    for _, row in data_lines(file):
        columns += row
        if len(columns) > MAX_POSE_VALUES:
            break
    values = numbers(columns[: MAX_POSE_VALUES + 1], where, "a 4x4 camera-to-world matrix")
    if len(values) != MAX_POSE_VALUES or not np.allclose(values[12:], (0, 0, 0, 1), atol=1e-3):
        raise DatasetError(f"{where} is no 4x4 camera-to-world matrix; copy it again from the data set.")
    matrix = np.reshape(values, (4, 4))
    try:
        return Pose.from_centre(matrix[:3, :3].T, matrix[:3, 3])
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None
