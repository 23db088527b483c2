"""Cambridge Landmarks folders: dataset_test.txt, dataset_train.txt, and lenses from cameras.txt or reconstruction.nvm.

A line is `seq1/frame00001.png X Y Z W P Q R`: the camera's centre in metres, and the world-to-camera quaternion w x y z
(VisualSFM's convention, whose axes are OpenCV's).
"""

from __future__ import annotations

from pathlib import Path

import cv2

from ..errors import CameraError, DatasetError, PhotoError
from ..geometry.camera import Intrinsics, Pose
from ..geometry.quaternion import rotation_from_quaternion
from ..photos.photo import read_photo
from ..support.words import counted
from .colmap import read_lens
from .names import match_names
from .text import data_lines, head, numbers
from .types import PosedFrame, PoseSet, QueryPhoto, Split, pose_set, short

LISTS: dict[Split, str] = {"test": "dataset_test.txt", "train": "dataset_train.txt"}
TITLE, COLUMN_TITLE = "Visual Landmark Dataset", "ImageFile,"
COLUMNS = 8
NVM, LENSES = "reconstruction.nvm", "cameras.txt"
PUBLISHED_SIZE = (1920, 1080)
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def detect(path: Path) -> bool:
    """A scene folder, or one of its lists."""
    if path.is_dir():
        return any((path / name).is_file() for name in LISTS.values())
    return path.name in LISTS.values() or head(path).startswith(TITLE)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The poses of a list; of a folder, those of the split's list. Raises DatasetError."""
    frames = []
    for where, columns in _rows(path / LISTS[split] if path.is_dir() else path):
        values = numbers(columns[1:], where, "X Y Z W P Q R")
        try:
            pose = Pose.from_centre(rotation_from_quaternion(values[3:]), values[:3])
        except CameraError as error:
            raise DatasetError(f"{where} cannot be used: {error}") from None
        frames.append(PosedFrame(columns[0], pose))
    return pose_set(path, frames, metric=True)


def queries(path: Path, focal: float | None = None) -> list[QueryPhoto]:
    """The photos of dataset_test.txt, with `focal` (pixels) or each photo's own lens. Raises DatasetError."""
    names = [columns[0] for _, columns in _rows(path / LISTS["test"])]
    if not names:
        raise DatasetError(f"'{path.name}/{LISTS['test']}' lists no photos; copy it again from the data set.")
    photos = [path / name for name in names]
    if focal is not None:
        lenses = [_lens(focal, photo) for photo in photos]
    elif (path / LENSES).is_file():
        lenses = _listed_lenses(path / LENSES, names)
    elif (path / NVM).is_file():
        lenses = [_lens(f, photo) for f, photo in zip(_nvm_focals(path / NVM, names), photos, strict=True)]
    else:
        raise DatasetError(f"'{path.name}' holds neither {LENSES} nor {NVM}; give the focal length in pixels with --focal.")
    return [QueryPhoto(name, photo, lens) for name, photo, lens in zip(names, photos, lenses, strict=True)]


def _rows(path: Path) -> list[tuple[str, list[str]]]:
    """The lines of a list below its titles."""
    rows = []
    for where, columns in data_lines(path):
        if columns[0] == COLUMN_TITLE or " ".join(columns).startswith(TITLE):
            continue
        if len(columns) != COLUMNS:
            raise DatasetError(
                f"{where} has {counted(len(columns), 'column')}; it should hold a photo's name and X Y Z W P Q R."
            )
        rows.append((where, columns))
    return rows


def _listed_lenses(path: Path, names: list[str]) -> list[Intrinsics]:
    """Lenses from lines `name MODEL width height parameters`, or the same one for all where there is a single line."""
    listed: dict[str, Intrinsics] = {}
    for where, columns in data_lines(path):
        lens = read_lens(columns[1:], where)
        if lens.intrinsics is None:
            raise DatasetError(f"{where} has a lens that is not supported ({lens.problem}); use PINHOLE, RADIAL or OPENCV.")
        listed[columns[0]] = lens.intrinsics
    if len(listed) == 1:
        return [*listed.values()] * len(names)
    found = match_names(names, list(listed), LISTS["test"], path.name)
    return [list(listed.values())[i] for i in _all_found(found, names, path)]


def _nvm_focals(path: Path, names: list[str]) -> list[float]:
    """Focal lengths (pixels) of the photos from a VisualSFM model, whose names end in .jpg; its points are not read."""
    focals: dict[str, float] = {}
    count = None
    for where, columns in data_lines(path):
        if columns[0].startswith("NVM_V3"):
            continue
        if count is None:
            count = int(numbers(columns[:1], where, "the number of cameras")[0])
        elif len(focals) < count:
            focals[columns[0]] = numbers(columns[1:2] or ["?"], where, "name, focal length, quaternion, centre")[0]
        if len(focals) == count:
            break
    found = match_names(names, list(focals), LISTS["test"], path.name)
    return [list(focals.values())[i] for i in _all_found(found, names, path)]


def _all_found(found: list[int | None], names: list[str], path: Path) -> list[int]:
    known = [i for i in found if i is not None]
    if len(known) < len(names):
        first = names[found.index(None)]
        missing = f"{len(names) - len(known)} of {counted(len(names), 'test photo')} ('{short(first)}')"
        raise DatasetError(f"'{path.name}' lacks the lens of {missing}; give one for all with --focal.")
    return known


def _lens(focal: float, photo: Path) -> Intrinsics:
    """A pinhole of that focal length and the photo's size. A photo that cannot be read is found out when its turn comes."""
    try:
        width, height = _size(photo)
    except (PhotoError, OSError, cv2.error):
        width, height = PUBLISHED_SIZE
    return Intrinsics(width, height, focal, focal, width / 2, height / 2)


def _size(photo: Path) -> tuple[int, int]:
    """Width and height as the photo will be read: of a PNG from its first bytes, for there are hundreds of them."""
    with photo.open("rb") as file:
        start = file.read(24)
    width, height = int.from_bytes(start[16:20]), int.from_bytes(start[20:24])
    if start.startswith(PNG_SIGNATURE) and width and height:
        return width, height
    picture = read_photo(photo)
    return picture.width, picture.height
