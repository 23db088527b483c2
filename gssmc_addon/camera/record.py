"""What a camera was solved to be, as one record on the camera's data: a camera JSON with its verdict.

It holds the pose in the splat file's coordinates and the lens in the photo's pixels, both as exact as they were found.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import bpy
import numpy as np

from ...core.cameras.files import camera_from_dict, camera_to_dict
from ...core.errors import GssmcError
from ...core.geometry.camera import Camera, Pose
from ...core.geometry.lie import so3_exp, so3_log
from ...core.pose.shared_records import PhotoSolution, own_record, takes_part

log = logging.getLogger(__name__)

NAMES = ("verdict", "iterations", "seconds", "lens_state", "median_depth", "points", "frame")
# What of a photo's own record is of no use for sharing its lens with other photos.
NOT_OWN = ("iterations", "start", "seconds", "stage")
POSE_NUMBERS = 6  # Per frame: rotation vector and translation, then fx, fy, cx, cy where the lens differs.


@dataclass(frozen=True)
class SolvedCamera:
    """The record. `camera` belongs to the photo at the size that was refined; `frame` of the scene where the photo moves.

    `median_depth` is in units of the splat's file, `points` the splat's count; `lens_state` as in camera_props. `path`: of a
    moving plate the camera at each frame that got a key. `own`: the record of the photo's own solution with what it left for
    sharing its lens (`own_part`), as text because panels read solutions at every drawing; "" where it can share none. It goes
    where the solution goes: a camera that is solved anew has another one, and of one that was changed neither holds.
    """

    camera: Camera
    verdict: str
    reasons: tuple[str, ...]
    iterations: int
    seconds: float
    lens_state: str
    median_depth: float = 0.0
    points: int = 0
    frame: int | None = None
    path: Mapping[int, Camera] = field(default_factory=dict)
    own: str = ""

    def camera_at(self, frame: int) -> Camera | None:
        """The camera at a frame of the scene; None where a path has no key."""
        return self.path.get(frame) if self.path else self.camera

    @property
    def keys_lens(self) -> bool:
        """Whether the lens changes along the path, and so gets keyframes too."""
        return any(camera.intrinsics != self.camera.intrinsics for camera in self.path.values())


def read(data: bpy.types.Camera) -> SolvedCamera | None:
    """The camera's record; None where there is none that can be read."""
    if not data.gssmc.solution:
        return None
    try:
        return loads(data.gssmc.solution)
    except (GssmcError, LookupError, TypeError, ValueError) as error:
        log.warning("The solution kept on %s cannot be read: %s", data.name, error)
        return None


def own_part(record: Mapping[str, Any]) -> str:
    """What of a photo's record, as the engine gives it, is kept for sharing its lens; "" where it can share none."""
    own = own_record(dict(record))
    return json.dumps({name: value for name, value in own.items() if name not in NOT_OWN}) if takes_part(own) else ""


def own_of(solution: SolvedCamera) -> dict[str, Any] | None:
    """The record of the photo's own solution; None where there is none that can be used."""
    try:
        own: dict[str, Any] = json.loads(solution.own)
    except ValueError:
        return None
    return own if isinstance(own, dict) and PhotoSolution.of(own) is not None else None


def dumps(solution: SolvedCamera) -> str:
    """The record as JSON text, which `loads` gives back; what JSON has no word for (NaN) must not be in it."""
    path = {str(frame): _numbers(camera, solution.camera) for frame, camera in solution.path.items()}
    values = {name: getattr(solution, name) for name in NAMES}
    values |= {"reasons": list(solution.reasons), "path": path, "own": solution.own}
    return json.dumps({**camera_to_dict(solution.camera), **values})


def loads(text: str) -> SolvedCamera:
    """Raises CameraError, or what Python raises for a value of another kind."""
    data = json.loads(text)
    camera = camera_from_dict(data, "The solution")
    return SolvedCamera(
        camera,
        str(data["verdict"]),
        tuple(str(reason) for reason in data["reasons"]),
        int(data["iterations"]),
        float(data["seconds"]),
        str(data["lens_state"]),
        float(data["median_depth"]),
        int(data["points"]),
        None if data["frame"] is None else int(data["frame"]),
        {int(frame): _with_numbers(camera, numbers) for frame, numbers in data["path"].items()},
        str(data.get("own", "")),
    )


def _numbers(camera: Camera, like: Camera) -> list[float]:
    k = camera.intrinsics
    lens = [k.fx, k.fy, k.cx, k.cy] if k != like.intrinsics else []
    return [*so3_log(camera.pose.R).tolist(), *camera.pose.t.tolist(), *lens]


def _with_numbers(like: Camera, numbers: list[Any]) -> Camera:
    pose = Pose(so3_exp(np.array(numbers[:3], np.float64)), np.array(numbers[3:POSE_NUMBERS], np.float64))
    if len(numbers) == POSE_NUMBERS:
        return replace(like, pose=pose)
    fx, fy, cx, cy = map(float, numbers[POSE_NUMBERS:])
    return replace(like, pose=pose, intrinsics=replace(like.intrinsics, fx=fx, fy=fy, cx=cx, cy=cy))
