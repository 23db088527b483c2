"""Polycam's raw data: a JSON file for each photo, with a camera-to-world matrix of an OpenGL camera and a lens in pixels.

The world is the capture's own, y up. (nerfstudio turns it on when it reads such a capture: what it calls x, y, z is z, x, y
here.) Of cameras that were corrected for the whole capture and those that were recorded, the corrected ones are taken.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import CameraError, DatasetError
from ...geometry.camera import Intrinsics
from ...geometry.conventions import pose_from_opengl
from ...geometry.foreign_lens import BROWN
from ..files import load_json
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, foreign, with_lens, without_lens

SIGNS = ('"t_00"', '"t_23"')
# Where the cameras lie in a capture's folder, and where their photos; the first that is there counts.
PLACES = tuple(
    (f"{folder}{kind}cameras", f"{folder}{kind}images") for kind in ("corrected_", "") for folder in ("keyframes/", "")
)


def detect(path: Path) -> bool:
    """A capture's folder, the folder of its cameras, or one of the files in it."""
    if path.is_dir():
        return _cameras(path) is not None
    start = begins(path)
    return start.lstrip().startswith("{") and all(sign in start for sign in SIGNS)


def read(path: Path, split: Split = "test") -> PoseSet:
    """All cameras of the capture, or of the one file. Raises DatasetError, CameraError."""
    cameras, photos = (_cameras(path) if path.is_dir() else None) or ([path], _photos_of(path.parent))
    frames, bad = collect(cameras, lambda file: _frame(file, f"{photos}{file.stem}.jpg"))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def _cameras(folder: Path) -> tuple[list[Path], str] | None:
    """The files of the cameras, and what stands before their photos' names, as the folder sees them; None where none are."""
    for cameras, photos in (*((place, f"{images}/") for place, images in PLACES), (".", _photos_of(folder))):
        files = sorted((folder / cameras).glob("*.json")) if (folder / cameras).is_dir() else []
        if files and all(sign in begins(files[0]) for sign in SIGNS):
            return files, photos
    return None


def _photos_of(cameras: Path) -> str:
    """What stands before the names of the photos, as the folder of their cameras sees them."""
    name = cameras.absolute().name
    return f"../{name.replace('cameras', 'images')}/" if name.endswith("cameras") else ""


def _frame(file: Path, photo: str) -> PosedFrame:
    record: Any = load_json(file)
    try:
        rows = finite([record[f"t_{row}{column}"] for row in range(3) for column in range(4)], 12).reshape(3, 4)
        pose = pose_from_opengl(rows)
    except (*FAULTS, CameraError):
        raise DatasetError(f"'{file.name}' has no matrix t_00 to t_23 of a camera; take it from the capture again.") from None
    try:
        width, height = int(record["width"]), int(record["height"])
        lens = foreign(BROWN, Intrinsics(width, height, *finite([record[key] for key in ("fx", "fy", "cx", "cy")], 4)), {})
    except (*FAULTS, CameraError):
        return without_lens(photo, pose)
    return with_lens(photo, pose, lens)
