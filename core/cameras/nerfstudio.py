"""nerfstudio's (and instant-ngp's) transforms.json: camera-to-world matrices of OpenGL cameras, in the file's own unit."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, Intrinsics, Pose
from ..geometry.conventions import pose_from_opengl, pose_to_opengl
from ..support.atomic import atomic_write
from .files import load_json
from .text import head
from .types import PosedFrame, PoseSet, Split, lens_of_file, pose_set

FILE = "transforms.json"
SIGNS = ('"transform_matrix"', '"fl_x"', '"camera_angle_x"')
NEEDED = ("w", "h", "fl_x", "cx", "cy")
DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def detect(path: Path) -> bool:
    """A folder with transforms.json, or such a file under another name."""
    if path.is_dir():
        return (path / FILE).is_file()
    start = head(path)
    return start.lstrip().startswith("{") and any(sign in start for sign in SIGNS)


def read(path: Path, split: Split = "test") -> PoseSet:
    """All frames of the file, in its own world: what nerfstudio's "applied_transform" did is not taken back.

    Raises DatasetError, CameraError.
    """
    file = path / FILE if path.is_dir() else path
    data = load_json(file)
    records = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(records, list):
        raise DatasetError(f"'{file.name}' has no list of cameras under \"frames\"; give at least one camera there.")
    frames = [_frame(record, data, f"Camera {number} of '{file.name}'") for number, record in enumerate(records, 1)]
    return pose_set(path, frames, metric=False)


def write_transforms(path: Path, cameras: Sequence[Camera]) -> None:
    """Write all cameras, the lens once where they share it. `read` gives the lenses back exactly, the poses to rounding."""
    shared = len({camera.intrinsics for camera in cameras}) == 1
    frames = [
        {
            "file_path": camera.file,
            **({} if shared else _lens_record(camera.intrinsics)),
            "transform_matrix": pose_to_opengl(camera.pose).tolist(),
        }
        for camera in cameras
    ]
    top = {"camera_model": "OPENCV", **(_lens_record(cameras[0].intrinsics) if shared else {})}
    with atomic_write(path) as file:
        json.dump({**top, "frames": frames}, file, indent=1)


def _frame(record: Any, top: dict[str, Any], where: str) -> PosedFrame:
    name = record.get("file_path") if isinstance(record, dict) else None
    if not isinstance(name, str) or not name or "transform_matrix" not in record:
        raise DatasetError(f'{where} lacks "file_path" or "transform_matrix"; export it again.')
    return PosedFrame(name, _pose(record["transform_matrix"], where), _lens({**top, **record}))


def _pose(matrix: Any, where: str) -> Pose:
    try:
        return pose_from_opengl(matrix)
    except (CameraError, ValueError, TypeError, OverflowError) as error:
        said = str(error) if isinstance(error, CameraError) else "Its matrix is not made of numbers; export it again."
        raise DatasetError(f"{where} cannot be used: {said}") from None


def _lens(values: dict[str, Any]) -> Intrinsics | None:
    """The lens where the file tells one that `Intrinsics` holds; poses can be compared without."""
    try:
        if "fl_x" not in values and "camera_angle_x" in values:
            values = {**values, "fl_x": 0.5 * values["w"] / math.tan(0.5 * values["camera_angle_x"])}
        width, height, fx, cx, cy = (float(values[name]) for name in NEEDED)
        k1, k2, p1, p2, k3 = (float(values.get(name, 0.0)) for name in DISTORTION)
        if "FISHEYE" in str(values.get("camera_model", "")) or values.get("k4"):
            return None
        fy = float(values.get("fl_y", fx))
        return lens_of_file(Intrinsics(int(width), int(height), fx, fy, cx, cy, (k1, k2, p1, p2, k3)))
    except (KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError, CameraError):
        return None


def _lens_record(k: Intrinsics) -> dict[str, float]:
    record: dict[str, float] = {"w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy}
    return record | dict(zip(DISTORTION, k.dist, strict=True))
