"""Record3D's recordings: a file named metadata, in a .r3d archive or in the folder that it was unpacked to or exported to.

"poses" holds x y z w of a quaternion and a place, camera-to-world of OpenGL cameras, y up; "K" the lens column by column, and
"perFrameIntrinsicCoeffs" fx fy cx cy of each frame, in pixels of "w" x "h". The photos are numbered from 0.
"""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import CameraError, DatasetError
from ...geometry.camera import FloatArray, Intrinsics
from ...geometry.conventions import pose_from_opengl
from ...geometry.foreign_lens import BROWN
from ...geometry.quaternion import rotation_from_quaternion
from ..files import load_json
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, HEAD_BYTES, begins, finite, foreign, with_lens, without_lens

MEMBER = "metadata"
FILES = (MEMBER, "metadata.json")
SIGNS = ('"poses"', '"K"')
LARGEST = 256 << 20
# Where the photos lie: in an archive, and in an exported folder.
PHOTOS = ("rgbd", "rgb")


def detect(path: Path) -> bool:
    """An archive with such a file, the file itself, or a folder that has it."""
    if path.is_dir():
        return any(_is_metadata(path / name) for name in FILES)
    return _is_metadata(path) or (begins(path).startswith("PK") and _is_archive(path))


def read(path: Path, split: Split = "test") -> PoseSet:
    """The frames of the recording. Raises DatasetError, CameraError."""
    file = next((path / name for name in FILES if (path / name).is_file()), path)
    data = _in_archive(path) if begins(file).startswith("PK") else load_json(file)
    folder = file.parent
    photos = next((name for name in PHOTOS if (folder / name).is_dir()), PHOTOS[0])
    try:
        poses = list(enumerate(data["poses"]))
    except FAULTS:
        raise DatasetError(f"'{path.name}' has no list of poses; export the recording from Record3D again.") from None
    frames, bad = collect(poses, lambda one: _frame(f"Frame {one[0]} of '{path.name}'", f"{photos}/{one[0]}.jpg", one, data))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def _is_metadata(file: Path) -> bool:
    """Whether the file begins as an object whose beginning or end has the names that tell it."""
    start = begins(file)
    if not start.lstrip().startswith("{"):
        return False
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - HEAD_BYTES))
        end = opened.read(HEAD_BYTES).decode("utf-8", errors="replace")
    return all(sign in start or sign in end for sign in SIGNS) and '"cameras"' not in start


def _is_archive(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return MEMBER in archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, UnicodeDecodeError):
        return False


def _in_archive(path: Path) -> Any:
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo(MEMBER).file_size > LARGEST:
                raise DatasetError(f"'{path.name}' holds {MEMBER} of more than {LARGEST >> 20} MB; export it again.")
            return json.loads(archive.read(MEMBER))
    except (zipfile.BadZipFile, OSError, ValueError, KeyError, NotImplementedError, RecursionError, RuntimeError, EOFError):
        raise DatasetError(f"'{path.name}' is a damaged recording; copy it from Record3D again.") from None


def _frame(where: str, photo: str, numbered: tuple[int, Any], data: Any) -> PosedFrame:
    number, values = numbered
    try:
        x, y, z, w, *centre = finite(values, 7).tolist()
        matrix = np.column_stack([rotation_from_quaternion((w, x, y, z)), centre])
        pose = pose_from_opengl(matrix)
    except (*FAULTS, CameraError):
        raise DatasetError(f"{where} has no quaternion and place of a camera; export the recording again.") from None
    try:
        lens = foreign(BROWN, Intrinsics(int(data["w"]), int(data["h"]), *_pinhole(number, data)), {})
    except (*FAULTS, CameraError):
        return without_lens(photo, pose)
    return with_lens(photo, pose, lens)


def _pinhole(number: int, data: Any) -> FloatArray:
    """fx, fy, cx, cy of a frame, or of the recording. Raises ValueError and the like."""
    each = data.get("perFrameIntrinsicCoeffs") or ()
    if number < len(each):
        return finite(each[number][:4], 4)
    return finite(data["K"], 9)[[0, 4, 6, 7]]
