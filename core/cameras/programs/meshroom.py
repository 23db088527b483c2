"""Meshroom's (AliceVision's) .sfm or .json: views, intrinsics and poses, joined by their ids; numbers are written as text.

A pose is a world-to-camera rotation, column by column, and a centre; OpenCV's axes. The focal length is in mm with the sensor's
width, or in pixels in older files; the centre is an offset from the picture's, or in older files a place. The photos are those
that are stored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...errors import CameraError, DatasetError
from ...geometry.camera import Intrinsics
from ...geometry.foreign_lens import BROWN, Lens
from ..files import load_json
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, foreign, pose_of, with_lens

# By the type of the distortion, or in older files of the intrinsics: the model, and the names of its parameters.
MODELS: dict[str, tuple[str, tuple[str, ...]]] = {
    **dict.fromkeys(("pinhole", "none", ""), (BROWN, ())),
    **dict.fromkeys(("radial1", "radialk1"), (BROWN, ("k1",))),
    **dict.fromkeys(("radial3", "radialk3"), (BROWN, ("k1", "k2", "k3"))),
    **dict.fromkeys(("brown", "brownt2"), (BROWN, ("k1", "k2", "k3", "p1", "p2"))),
    **dict.fromkeys(("fisheye4", "fisheyek4", "fisheye"), ("OPENCV_FISHEYE", ("k1", "k2", "k3", "k4"))),
    "equirectangular": ("EQUIRECTANGULAR", ()),
}


def detect(path: Path) -> bool:
    start = begins(path)
    return start.lstrip().startswith("{") and '"views"' in start and ('"intrinsicId"' in start or '"viewId"' in start)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The views that have a pose. Raises DatasetError, CameraError."""
    data = load_json(path)
    try:
        lenses = {str(one["intrinsicId"]): _lens(one) for one in data.get("intrinsics", [])}
        poses = {str(one["poseId"]): one["pose"]["transform"] for one in data.get("poses", [])}
        views = [(str(view["path"]), str(view.get("poseId")), str(view.get("intrinsicId"))) for view in data["views"]]
    except FAULTS:
        raise DatasetError(
            f"'{path.name}' is no file of cameras of Meshroom; take cameras.sfm of its StructureFromMotion."
        ) from None
    placed = [view for view in views if view[1] in poses]

    def frame_of(view: tuple[str, str, str]) -> PosedFrame:
        name = PurePosixPath(view[0].replace("\\", "/")).name
        return _frame(f"The view '{name:.60}' of '{path.name}'", name, poses[view[1]], lenses.get(view[2], Lens(None)))

    frames, bad = collect(placed, frame_of)
    found = pose_set(path, frames, metric=False, unsolved=len(views) - len(placed), bad=bad)
    return replace(found, pixel_order="stored")


def _frame(where: str, name: str, transform: Any, lens: Lens) -> PosedFrame:
    try:
        rotation, centre = finite(transform["rotation"], 9).reshape(3, 3).T, finite(transform["center"], 3)
    except FAULTS:
        raise DatasetError(f"{where} has no rotation and centre; compute the cameras again.") from None
    return with_lens(name, pose_of(where, rotation, centre), lens)


def _lens(record: Mapping[str, Any]) -> Lens:
    try:
        width, height = int(float(record["width"])), int(float(record["height"]))
        focal = _focal(record, width)
        shift = record.get("principalPoint", (0, 0))
        x, y = finite(shift.values() if isinstance(shift, Mapping) else shift, 2)
        # Older files give the place itself, newer ones its distance from the picture's centre.
        absolute = x > width / 4 and y > height / 4
        cx, cy = (x, y) if absolute else (x + width / 2, y + height / 2)
        kind = str(record.get("distortionType") or record.get("type", "")).lower()
        model, names = MODELS.get(kind, (kind, ()))
        given = record.get("distortionParams") or ()
        values = dict(zip(names, (float(value) for value in given), strict=False))
        return foreign(model, Intrinsics(width, height, *focal, float(cx), float(cy)), values)
    except (*FAULTS, CameraError):
        return Lens(None, "the lens is left out, for its values make none")


def _focal(record: Mapping[str, Any], width: int) -> tuple[float, float]:
    """Focal lengths in pixels."""
    if "pxFocalLength" in record:
        values = np.atleast_1d(np.asarray(record["pxFocalLength"], np.float64))
        return float(values[0]), float(values[-1])
    focal = float(record["focalLength"]) / float(record["sensorWidth"]) * width
    return focal, focal / float(record.get("pixelRatio") or 1)
