"""nerfstudio's (and instant-ngp's) transforms.json: camera-to-world matrices of OpenGL cameras, in the file's own unit.

They belong to the photos' pixels as they are stored: neither COLMAP, which places them, nor nerfstudio turns photos by EXIF.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import CameraError, DatasetError
from ..geometry.camera import Camera, Intrinsics, Pose
from ..geometry.conventions import pose_from_opengl, pose_to_opengl
from ..geometry.foreign_lens import BROWN, PANORAMAS, Lens, lens_of
from ..geometry.lens_models import EQUIRECTANGULAR
from ..geometry.pinhole_cut import WideCamera
from ..geometry.wide_lens import WideLens
from ..support.atomic import atomic_write
from .files import load_json
from .text import head
from .types import PosedFrame, PoseSet, Split, collect, lens_of_file, pose_set

FILE = "transforms.json"
SIGNS = ('"transform_matrix"', '"fl_x"', '"camera_angle_x"')
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2")
NUMBERS = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "cx", "cy", *COEFFICIENTS)
# camera_model to the model of foreign_lens; what is not here has that name there, or none.
MODELS = {name: BROWN for name in ("", "OPENCV", "PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")}
MODELS |= {"FISHEYE": "OPENCV_FISHEYE", "OMNIDIRECTIONALSTEREO_L": "EQUIRECTANGULAR"}
# What nerfstudio's fisheye can say.
FISHEYES = ("OPENCV_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "SIMPLE_FISHEYE", "FISHEYE")
FISHEYE_NAMES = ("k1", "k2", "k3", "k4")


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
    numbered = [(f"Camera {number} of '{file.name}'", record) for number, record in enumerate(records, 1)]
    frames, bad = collect(numbered, lambda one: _frame(one[1], data, one[0]))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def write_transforms(path: Path, cameras: Sequence[Camera]) -> None:
    """Write all cameras, the lens once where they share it. `read` gives the lenses back exactly, the poses to rounding.

    Raises DatasetError where nerfstudio has no such lens.
    """
    records = [_lens_record(camera) for camera in cameras]
    shared = all(record == records[0] for record in records)
    frames = [
        {
            "file_path": camera.file,
            **({} if shared else record),
            "transform_matrix": pose_to_opengl(camera.pose).tolist(),
        }
        for camera, record in zip(cameras, records, strict=True)
    ]
    top = records[0] if shared else {"camera_model": "OPENCV"}
    with atomic_write(path) as file:
        json.dump({**top, "frames": frames}, file, indent=1)


def _frame(record: Any, top: dict[str, Any], where: str) -> PosedFrame:
    name = record.get("file_path") if isinstance(record, dict) else None
    if not isinstance(name, str) or not name or "transform_matrix" not in record:
        raise DatasetError(f'{where} lacks "file_path" or "transform_matrix"; export it again.')
    pose = _pose(record["transform_matrix"], where)
    # A frame's own values go before those of the file; null is as good as nothing.
    values = {key: value for key, value in {**top, **record}.items() if value is not None}
    try:
        lens_of_size = _lens(values)
        if lens_of_size is None:
            return PosedFrame(name, pose)
        if "w" not in values or "h" not in values:
            return PosedFrame(name, pose, lens_of_size=lambda width, height: _exact(lens_of_size(width, height)))
        lens = lens_of_size(int(float(values["w"])), int(float(values["h"])))
    except (TypeError, ValueError, OverflowError, ZeroDivisionError, CameraError):
        return PosedFrame(name, pose, problem="the lens is left out, for its values make none")
    return PosedFrame(name, pose, lens.intrinsics, problem=lens.problem, is_picture=lens.is_picture, wide=lens.wide)


def _pose(matrix: Any, where: str) -> Pose:
    try:
        return pose_from_opengl(matrix)
    except (CameraError, ValueError, TypeError, OverflowError) as error:
        said = str(error) if isinstance(error, CameraError) else "Its matrix is not made of numbers; export it again."
        raise DatasetError(f"{where} cannot be used: {said}") from None


def _exact(lens: Lens) -> Intrinsics | WideLens:
    found = lens.intrinsics or lens.wide
    if found is None:
        raise CameraError(f"The photo's lens cannot be used: {lens.problem}.")
    return found


def _lens(values: dict[str, Any]) -> Callable[[int, int], Lens] | None:
    """What the file tells of a lens, for a photo of a width and height: the centre is the photo's where none is given, and the
    focal length may be said as an angle. None where it tells none. Raises ValueError and the like.
    """
    model = str(values.get("camera_model", "")).upper()
    model = MODELS.get(model, model)
    if model not in PANORAMAS and not any(key in values for key in ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y")):
        return None
    numbers = {key: float(values[key]) for key in NUMBERS if key in values}

    def at(width: int, height: int) -> Lens:
        fx, fy = (_focal(numbers, axis, size) for axis, size in (("x", width), ("y", height)))
        fx, fy = fx or fy or float(width), fy or fx or float(width)
        pinhole = Intrinsics(width, height, fx, fy, numbers.get("cx", width / 2), numbers.get("cy", height / 2))
        return lens_of(model, lens_of_file(pinhole), {key: numbers[key] for key in COEFFICIENTS if key in numbers})

    return at


def _focal(numbers: dict[str, float], axis: str, size: int) -> float | None:
    if f"fl_{axis}" in numbers:
        return numbers[f"fl_{axis}"]
    angle = numbers.get(f"camera_angle_{axis}")
    return None if angle is None else size / 2 / math.tan(angle / 2)


def _lens_record(camera: Camera) -> dict[str, float | str]:
    if isinstance(camera, WideCamera):
        return _wide_record(camera.lens)
    k = camera.intrinsics
    record: dict[str, float | str] = {"camera_model": "OPENCV", "w": k.width, "h": k.height}
    record |= {"fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy}
    return record | dict(zip(DISTORTION, k.dist, strict=True))


def _wide_record(lens: WideLens) -> dict[str, float | str]:
    sizes: dict[str, float | str] = {"w": lens.width, "h": lens.height}
    if lens.is_panorama:
        return {"camera_model": EQUIRECTANGULAR, **sizes}
    if lens.model not in FISHEYES:
        raise DatasetError(f"nerfstudio has no lens model {lens.model}; write --to json or --to colmap.")
    lengths = {"fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy}
    return {"camera_model": FISHEYES[0], **sizes, **lengths, **{name: lens.values.get(name, 0.0) for name in FISHEYE_NAMES}}
