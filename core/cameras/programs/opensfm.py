"""OpenSfM's (OpenDroneMap's) reconstruction.json: cameras by name, and shots with an angle-axis rotation and a translation.

World-to-camera, OpenCV's axes; focal lengths and centres are shares of the photo's long side, the centre an offset from its
middle. Of several reconstructions, each in a world of its own, the first is taken. The photos are those that are stored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import CameraError, DatasetError
from ...geometry.camera import Intrinsics, Pose
from ...geometry.foreign_lens import BROWN, Lens
from ...geometry.lie import so3_exp
from ..files import load_json
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins, finite, foreign, with_lens

MODELS = {"perspective": BROWN, "brown": BROWN, "simple_radial": BROWN, "radial": BROWN, "fisheye": "OPENCV_FISHEYE"}
MODELS |= {"fisheye_opencv": "OPENCV_FISHEYE", "spherical": "SPHERICAL", "equirectangular": "EQUIRECTANGULAR"}


def detect(path: Path) -> bool:
    start = begins(path)
    return start.lstrip()[:1] in ("[", "{") and '"cameras"' in start and '"projection_type"' in start


def read(path: Path, split: Split = "test") -> PoseSet:
    """The shots of the first reconstruction. Raises DatasetError, CameraError."""
    data = load_json(path)
    parts = data if isinstance(data, list) else [data]
    try:
        lenses = {name: _lens(camera) for name, camera in parts[0]["cameras"].items()}
        shots = list(parts[0]["shots"].items())
    except FAULTS:
        raise DatasetError(
            f"'{path.name}' holds no reconstruction with cameras and shots; take it from OpenSfM again."
        ) from None
    frames, bad = collect(shots, lambda shot: _frame(f"The shot '{shot[0]:.60}' of '{path.name}'", shot, lenses))
    others = sum(len(part.get("shots", ())) for part in parts[1:] if isinstance(part, dict))
    found = pose_set(path, frames, metric=False, unsolved=others, bad=bad)
    return replace(found, pixel_order="stored")


def _frame(where: str, shot: tuple[str, Any], lenses: Mapping[str, Lens]) -> PosedFrame:
    name, record = shot
    try:
        rotation, translation = finite(record["rotation"], 3), finite(record["translation"], 3)
        lens = lenses.get(str(record.get("camera")), Lens(None))
    except FAULTS:
        raise DatasetError(f"{where} has no rotation and translation; take the file from OpenSfM again.") from None
    return with_lens(name, Pose(so3_exp(rotation), translation), lens)


def _lens(record: Mapping[str, Any]) -> Lens:
    try:
        width, height = int(record["width"]), int(record["height"])
        long = max(width, height)
        kind = str(record["projection_type"])
        model = MODELS.get(kind, kind)
        fx = float(record.get("focal_x", record.get("focal", 1.0))) * long
        fy = float(record.get("focal_y", fx / long)) * long
        cx, cy = (middle + float(record.get(key, 0)) * long for middle, key in ((width / 2, "c_x"), (height / 2, "c_y")))
        values = {key: float(record[key]) for key in ("k1", "k2", "k3", "k4", "p1", "p2") if key in record}
        return foreign(model, Intrinsics(width, height, fx, fy, cx, cy), values)
    except (*FAULTS, CameraError):
        return Lens(None, "the lens is left out, for its values make none")
