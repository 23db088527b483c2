"""fSpy's projects: the camera of one picture, found from its vanishing points, in a world that the user's axes make.

Four bytes "fspy", the version, the length of a JSON text and that of the picture behind it (fSpy's description of its project
files). The camera-to-world matrix is Blender's: the camera looks along -z with y up. The centre is given with the picture's
longer half as unit, y up; the angle is the one across the picture's width.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

from ...errors import CameraError, DatasetError
from ...geometry.camera import Intrinsics
from ...geometry.conventions import pose_from_opengl
from ..types import PosedFrame, PoseSet, Split, lens_of_file, pose_set
from .parts import FAULTS, begins, finite

SIGN, HEADER, VERSION = b"fspy", struct.Struct("<4sIII"), 1
LARGEST = 64 << 20
OWN_WORLD = "its place is in fSpy's own axes, which are the splat's only if you made them so; its lens counts as a guess"


def detect(path: Path) -> bool:
    return begins(path).startswith(SIGN.decode())


def read(path: Path, split: Split = "test") -> PoseSet:
    """The one camera of the project, which is named as its file is. Raises DatasetError."""
    found = _state(path).get("cameraParameters")
    if not isinstance(found, dict):
        raise DatasetError(f"'{path.name}' has no camera yet; place its vanishing points in fSpy and save it again.")
    try:
        rows = found["cameraTransform"]["rows"]
        pose = pose_from_opengl(finite([value for row in rows for value in row], 16).reshape(4, 4))
        lens = _lens(found)
    except (*FAULTS, CameraError):
        raise DatasetError(f"The camera in '{path.name}' cannot be used; save the project in fSpy again.") from None
    return pose_set(path, [PosedFrame(path.stem, pose, lens, problem=OWN_WORLD, focal_guessed=True)], metric=False)


def _state(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            _, version, length, _ = HEADER.unpack(file.read(HEADER.size))
            text = file.read(length) if length <= LARGEST else b""
        state = json.loads(text)
    except OSError as error:
        raise DatasetError(f"'{path}' cannot be read ({error.strerror}); check the path.") from error
    except (struct.error, ValueError, RecursionError):
        raise DatasetError(f"'{path.name}' is a damaged fSpy project; save it in fSpy again.") from None
    if version != VERSION or not isinstance(state, dict):
        raise DatasetError(f"'{path.name}' is an fSpy project of version {version}; version 1 can be read.")
    return state


def _lens(found: dict[str, Any]) -> Intrinsics:
    """Raises ValueError and the like, and CameraError."""
    width, height, angle = int(found["imageWidth"]), int(found["imageHeight"]), float(found["horizontalFieldOfView"])
    x, y = finite([found["principalPoint"][axis] for axis in ("x", "y")], 2).tolist()
    focal, half = width / 2 / math.tan(angle / 2), max(width, height) / 2
    return lens_of_file(Intrinsics(width, height, focal, focal, width / 2 + x * half, height / 2 - y * half))
