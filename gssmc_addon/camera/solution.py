"""Compares a camera with the record of its solution (see record), and restores the solution.

That is worked out when somebody asks, from where the camera stands then: so nothing that moves it can go unnoticed, be it undo,
a parent, a keyframe or a script, and splat and camera that are moved together stay solved.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np

from ...core.errors import CameraError
from ...core.geometry.camera import Intrinsics, Pose, pose_error
from ...core.pose.report import RefineReport
from ...core.pose.report_json import report_to_dict
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..registration.camera_props import keep_verdict
from ..support.texts import iface_, n_, rpt_
from . import bridge as camera_bridge
from . import channels as camera_channels
from . import keys as camera_keys
from . import record as camera_record
from .record import SolvedCamera

# Blender keeps float32. What is allowed is below a tenth of a pixel of a photo of some thousand pixels.
SAME_PLACE = 1e-4  # of the median depth
SAME_TURN_DEG = 0.01
SAME_LENS = 2e-5  # Relative to the focal length, and for the principal point to the photo's long side.
SAME_DISTORTION = 1e-5
FLOAT32 = 4 * float(np.finfo(np.float32).eps)  # A world matrix is a product of several float32 matrices.

CHANGED = "CHANGED"
TITLES = {
    "PHOTO": n_("Another photo since it was solved"),
    "SPLAT": n_("The splat changed since it was solved"),
    "FRAME": n_("Solved at another frame"),
    "MOVED": n_("Moved since it was solved"),
    "LENS": n_("The lens changed since it was solved"),
}


def of_report(report: RefineReport, lens_state: str) -> SolvedCamera:
    """The solution that a refinement found; its lens counts as solved where it was solved for."""
    solved = report.solved_lens and report.camera is not report.start
    depth = report.quality.median_depth if report.quality else 0.0
    return SolvedCamera(
        report.camera,
        report.verdict,
        report.reasons,
        len(report.iterations),
        report.seconds,
        "SOLVED" if solved else lens_state,
        depth if math.isfinite(depth) else 0.0,
        own=camera_record.own_part(report_to_dict(report)) if report.lens_evidence else "",
    )


def keep(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, solution: SolvedCamera) -> None:
    """Writes the record of a camera that was just set to it, and its verdict, and shows its photo as it is: the verdict is
    about that.
    """
    photo_image.straighten(camera.data)
    props, image = camera.data.gssmc, photo_image.camera_photo(camera)
    moves = image.source in plate_source.MOVING if image else plate_source.has_clip(camera)
    solution = replace(solution, points=len(splat.data.points), frame=scene.frame_current if moves else None)
    keep_verdict(camera.data, solution.verdict, solution.reasons, solution.iterations, solution.seconds)
    props.lens_state = solution.lens_state
    props.solution, props.solved_photo = camera_record.dumps(solution), image


def change(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """What differs from the solution, as a key of TITLES; "" when nothing does, or the camera was never solved."""
    solution = camera_record.read(camera.data)
    if solution is None:
        return ""
    return _change_of_photo(scene, camera, solution) or _change_of_camera(scene, camera, solution)


def _change_of_photo(scene: bpy.types.Scene, camera: bpy.types.Object, solution: SolvedCamera) -> str:
    image, size = photo_image.camera_photo(camera), photo_image.own_size(camera.data)
    gone = image is None and not plate_source.has_clip(camera)
    if gone or image != camera.data.gssmc.solved_photo or not _has_shape(solution.camera.intrinsics, size):
        return "PHOTO"
    return "FRAME" if _other_frame(scene, solution) else ""


def _other_frame(scene: bpy.types.Scene, solution: SolvedCamera) -> bool:
    """Whether the photo moves and the scene shows a frame of it for which nothing was solved."""
    now = scene.frame_current
    if solution.path:
        return not min(solution.path) <= now <= max(solution.path)
    return solution.frame is not None and solution.frame != now


def _change_of_camera(scene: bpy.types.Scene, camera: bpy.types.Object, solution: SolvedCamera) -> str:
    splat, then = scene.gssmc.splat, solution.camera_at(scene.frame_current)
    if splat is None or splat.type != "POINTCLOUD" or len(splat.data.points) != solution.points:
        return "SPLAT"
    if then is None:  # between two keyframes
        return ""
    lens = then.intrinsics
    try:
        now = camera_bridge.read_camera(scene, camera, splat).at_size(lens.width, lens.height)
    except CameraError:  # The camera became orthographic, or camera or splat were sheared.
        return "MOVED"
    places = [camera_bridge.world_matrix(obj) for obj in (camera, splat)]
    reach = max(place.translation.length for place in places)
    slack = SAME_PLACE * solution.median_depth + FLOAT32 * reach / places[1].median_scale
    if not _is_same_pose(now.pose, then.pose, slack):
        return "MOVED"
    return "" if _is_same_lens(now.intrinsics, lens) else "LENS"


def moved_at(scene: bpy.types.Scene, camera: bpy.types.Object, then: SolvedCamera, frames: Iterable[int]) -> list[int]:
    """Those of the frames at which the camera no longer stands where the path of `then` has it. Scene and camera end as they
    were.
    """
    found = []
    with camera_keys.put_back(scene, camera):
        for frame in frames:
            scene.frame_set(frame)
            if _change_of_camera(scene, camera, then) == "MOVED":
                found.append(frame)
    return found


def verdict(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """The camera's verdict as it holds now: CHANGED where the camera is no longer what was trusted, or to be checked."""
    kept: str = camera.data.gssmc.verdict
    return CHANGED if kept in ("TRUSTED", "CHECK", "PINNED") and change(scene, camera) else kept


def title(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """One line on what changed since the camera was solved; "" when nothing did."""
    what = change(scene, camera)
    solution = camera_record.read(camera.data) if what == "FRAME" else None
    if solution and solution.path:
        return iface_("Solved from frame {first} to {last}", first=min(solution.path), last=max(solution.path))
    if solution:
        return iface_("Solved at frame {frame}", frame=solution.frame)
    return iface_(TITLES[what]) if what else ""


def put_back(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Restores photo, pose, lens and verdict of the solution. Returns a sentence on keyframes that were set, or "".

    Raises CameraError, with nothing changed, when there is no record, or camera or splat cannot carry it.
    """
    solution, splat = camera_record.read(camera.data), scene.gssmc.splat
    if solution is None:
        raise CameraError(rpt_('The camera "{name}" was never solved; use Find Camera or Refine Camera.', name=camera.name))
    if splat is None or splat.type != "POINTCLOUD":
        raise CameraError(rpt_("The solution stands in the splat; import or pick the splat first."))
    camera_channels.check_writable(camera)
    keyed = _write(scene, camera, splat, solution)
    props = camera.data.gssmc
    if props.solved_photo and photo_image.camera_photo(camera) != props.solved_photo:
        props.photo = props.solved_photo  # its update shows it
        camera_bridge.write_intrinsics(scene, camera.data, solution.camera.intrinsics)
    frames = len(solution.path) and (props.frames_done or len(solution.path))
    keep_verdict(camera.data, solution.verdict, solution.reasons, solution.iterations, solution.seconds)
    props.lens_state, props.frames_done = solution.lens_state, frames
    return keyed


def _write(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, solution: SolvedCamera) -> str:
    if solution.path:
        keys = camera_keys.KeyOptions.as_keyed(camera, solution.keys_lens)
        camera_keys.write(scene, camera, splat, dict(solution.path), keys)
        return rpt_("Its keyframes are those that were solved.")
    if solution.frame is not None and solution.frame != scene.frame_current:
        scene.frame_set(solution.frame)  # Each frame of a moving photo has a camera of its own.
    camera_bridge.write_camera(scene, camera, splat, solution.camera)
    return camera_channels.write_keyframes(scene, camera)


def _has_shape(lens: Intrinsics, size: tuple[int, int]) -> bool:
    """Allows for the pixel that is lost when a copy is made smaller; True where the photo's size is not known."""
    return not all(size) or abs(lens.width * size[1] - lens.height * size[0]) <= max(lens.width, lens.height, *size)


def _is_same_pose(now: Pose, then: Pose, slack: float) -> bool:
    distance, degrees = pose_error(now, then)
    return distance <= slack and degrees <= SAME_TURN_DEG


def _is_same_lens(now: Intrinsics, then: Intrinsics) -> bool:
    focal = abs(now.fx / then.fx - 1), abs(now.fy / then.fy - 1)
    centre = np.hypot(now.cx - then.cx, now.cy - then.cy) / max(then.width, then.height)
    bent = [abs(a - b) / max(1.0, abs(b)) for a, b in zip(now.dist, then.dist, strict=True)]
    return max(*focal, centre) <= SAME_LENS and max(bent) <= SAME_DISTORTION
