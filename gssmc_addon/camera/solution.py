"""What a camera was solved to be, kept on it as one record, and whether it still is that.

The record holds the pose in the splat file's coordinates and the lens in the photo's pixels. Whether the camera still agrees is
worked out when somebody asks, from where it stands then: so nothing that moves it can go unnoticed, be it undo, a parent,
a keyframe or a script, and splat and camera that are moved together stay solved.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...core.cameras.files import camera_from_dict, camera_to_dict
from ...core.errors import CameraError, GssmcError
from ...core.geometry.camera import Camera, Intrinsics, Pose, pose_error
from ...core.pose.report import RefineReport
from ..photo import image as photo_image
from ..registration.camera_props import note_verdict
from ..support.texts import iface_, n_, rpt_
from . import bridge as camera_bridge
from . import channels as camera_channels

log = logging.getLogger(__name__)

MOVING = ("SEQUENCE", "MOVIE")  # sources of an image that is another photo at every frame
# Blender keeps float32. What is allowed is below a tenth of a pixel of a photo of some thousand pixels.
SAME_PLACE = 1e-4  # of the median depth
SAME_TURN_DEG = 0.01
SAME_LENS = 2e-5  # of the focal length, and of the photo's long side for the principal point
SAME_DISTORTION = 1e-5
FLOAT32 = 4 * float(np.finfo(np.float32).eps)  # a world matrix is a product of some

CHANGED = "CHANGED"
TITLES = {
    "PHOTO": n_("Another photo since it was solved"),
    "SPLAT": n_("The splat changed since it was solved"),
    "FRAME": n_("Solved at another frame"),
    "MOVED": n_("Moved since it was solved"),
    "LENS": n_("The lens changed since it was solved"),
}


@dataclass(frozen=True)
class Solution:
    """The record. `camera` belongs to the photo at the size that was refined; `frame` of the scene where the photo moves.

    `median_depth` is in units of the splat's file, `points` the splat's count; `lens_state` as in camera_props.
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


def of_report(report: RefineReport, lens_state: str) -> Solution:
    """The solution that a refinement found; its lens counts as solved where it was solved for."""
    solved = report.lens != "fixed" and report.camera is not report.start
    return Solution(
        report.camera,
        report.verdict,
        report.reasons,
        len(report.iterations),
        report.seconds,
        "SOLVED" if solved else lens_state,
        report.quality.median_depth if report.quality else 0.0,
    )


def keep(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, found: Solution) -> None:
    """Writes the record of a camera that was just set to it, and its verdict."""
    note, image = camera.data.gssmc, photo_image.camera_photo(camera)
    moves = image is not None and image.source in MOVING
    found = replace(found, points=len(splat.data.points), frame=scene.frame_current if moves else None)
    note_verdict(camera.data, found.verdict, found.reasons, found.iterations, found.seconds)
    note.lens_state = found.lens_state
    note.solution, note.solved_photo = json.dumps(_to_dict(found)), image


def read(data: bpy.types.Camera) -> Solution | None:
    """The camera's record; None where there is none that can be read."""
    if not data.gssmc.solution:
        return None
    try:
        return _from_dict(json.loads(data.gssmc.solution))
    except (GssmcError, LookupError, TypeError, ValueError) as error:
        log.warning("The solution kept on %s cannot be read: %s", data.name, error)
        return None


def change(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """What is no longer as it was solved, a key of TITLES; "" when all is, or the camera was never solved."""
    found = read(camera.data)
    if found is None:
        return ""
    return _change_of_photo(scene, camera, found) or _change_of_camera(scene, camera, found)


def _change_of_photo(scene: bpy.types.Scene, camera: bpy.types.Object, found: Solution) -> str:
    image, size = photo_image.camera_photo(camera), photo_image.own_size(camera.data)
    if image is None or image != camera.data.gssmc.solved_photo or not _has_shape(found.camera.intrinsics, size):
        return "PHOTO"
    return "FRAME" if found.frame is not None and found.frame != scene.frame_current else ""


def _change_of_camera(scene: bpy.types.Scene, camera: bpy.types.Object, found: Solution) -> str:
    splat, lens = scene.gssmc.splat, found.camera.intrinsics
    if splat is None or splat.type != "POINTCLOUD" or len(splat.data.points) != found.points:
        return "SPLAT"
    try:
        now = camera_bridge.read_camera(scene, camera, splat).at_size(lens.width, lens.height)
    except CameraError:  # it became orthographic, or sheared; or the splat did
        return "MOVED"
    reach = max(camera.matrix_world.translation.length, splat.matrix_world.translation.length)
    slack = SAME_PLACE * found.median_depth + FLOAT32 * reach / splat.matrix_world.median_scale
    if not _is_same_pose(now.pose, found.camera.pose, slack):
        return "MOVED"
    return "" if _is_same_lens(now.intrinsics, lens) else "LENS"


def verdict(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """The camera's verdict as it holds now: CHANGED where the camera is no longer what was trusted, or to be checked."""
    said: str = camera.data.gssmc.verdict
    return CHANGED if said in ("TRUSTED", "CHECK") and change(scene, camera) else said


def title(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """One line on what changed since the camera was solved; "" when nothing did."""
    what = change(scene, camera)
    if what == "FRAME":
        found = read(camera.data)
        return iface_("Solved at frame {frame}", frame=found.frame if found else 0)
    return iface_(TITLES[what]) if what else ""


def put_back(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Makes the camera what it was solved to be: photo, pose, lens and verdict. A sentence on keyframes that were set; "".

    Raises CameraError, with nothing changed, when there is no record, or camera or splat cannot carry it.
    """
    found, splat = read(camera.data), scene.gssmc.splat
    if found is None:
        raise CameraError(rpt_('The camera "{name}" was never solved; use Refine Camera.', name=camera.name))
    if splat is None or splat.type != "POINTCLOUD":
        raise CameraError(rpt_("The solution stands in the splat; import or pick the splat first."))
    camera_channels.check_writable(camera)
    if found.frame is not None and found.frame != scene.frame_current:
        scene.frame_set(found.frame)  # of a moving photo another frame has another camera
    camera_bridge.write_camera(scene, camera, splat, found.camera)
    note = camera.data.gssmc
    if note.solved_photo and photo_image.camera_photo(camera) != note.solved_photo:
        note.photo = note.solved_photo  # its update shows it
        camera_bridge.write_intrinsics(scene, camera.data, found.camera.intrinsics)
    keyed = camera_channels.write_keyframes(scene, camera)
    note_verdict(camera.data, found.verdict, found.reasons, found.iterations, found.seconds)
    note.lens_state = found.lens_state
    return keyed


def _has_shape(lens: Intrinsics, size: tuple[int, int]) -> bool:
    """Up to the pixel that making a copy smaller may round away; True where the photo's size is not known."""
    return not all(size) or abs(lens.width * size[1] - lens.height * size[0]) <= max(lens.width, lens.height, *size)


def _is_same_pose(now: Pose, then: Pose, slack: float) -> bool:
    distance, degrees = pose_error(now, then)
    return distance <= slack and degrees <= SAME_TURN_DEG


def _is_same_lens(now: Intrinsics, then: Intrinsics) -> bool:
    focal = abs(now.fx / then.fx - 1), abs(now.fy / then.fy - 1)
    centre = np.hypot(now.cx - then.cx, now.cy - then.cy) / max(then.width, then.height)
    bent = [abs(a - b) / max(1.0, abs(b)) for a, b in zip(now.dist, then.dist, strict=True)]
    return max(*focal, centre) <= SAME_LENS and max(bent) <= SAME_DISTORTION


def _to_dict(found: Solution) -> dict[str, Any]:
    names = ("verdict", "iterations", "seconds", "lens_state", "median_depth", "points", "frame")
    said = {name: getattr(found, name) for name in names}
    return {**camera_to_dict(found.camera), **said, "reasons": list(found.reasons)}


def _from_dict(data: dict[str, Any]) -> Solution:
    """Raises CameraError, or what Python raises for a value of another kind."""
    return Solution(
        camera_from_dict(data, "The solution"),
        str(data["verdict"]),
        _sentences(data["reasons"]),
        int(data["iterations"]),
        float(data["seconds"]),
        str(data["lens_state"]),
        float(data["median_depth"]),
        int(data["points"]),
        None if data["frame"] is None else int(data["frame"]),
    )


def _sentences(value: Sequence[Any]) -> tuple[str, ...]:
    return tuple(str(item) for item in value)
