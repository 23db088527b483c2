"""Other starts for a photo whose camera was not found: the cameras of solved photos of the list."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.errors import CameraError
from ...core.geometry.camera import Pose, pose_error
from ..camera import bridge as camera_bridge
from ..camera import solution as camera_solution
from . import list as photo_list

NEAR, SPREAD = 2, 2  # How many starts are the nearest cameras, and how many lie far from those and from each other.


@dataclass(frozen=True)
class Neighbour:
    """A solved photo's camera: its name, and its pose in the splat file's coordinates."""

    name: str
    pose: Pose


def starts(scene: bpy.types.Scene, splat: bpy.types.Object, camera: int) -> list[Neighbour]:
    """The starts for the camera of this session id, best first; none where no photo of the list is solved.

    The nearest come first, for a start is seldom all wrong. Where it is (photos that were added at one view), the spread-out
    ones see the scene from all around. Where photos are trusted, those that are to be checked are no starts.
    """
    own = next((c for c in photo_list.cameras(scene) if c.session_uid == camera), None)
    verdicts = {c: camera_solution.verdict(scene, c) for c in photo_list.cameras(scene) if c != own}
    best = next((word for word in ("TRUSTED", "CHECK") if word in verdicts.values()), "")
    solved = [n for n in (_neighbour(scene, splat, c) for c, word in verdicts.items() if word == best) if n] if best else []
    here = _neighbour(scene, splat, own) if own else None
    return choose(here.pose, solved) if here else []


def choose(here: Pose, solved: Sequence[Neighbour]) -> list[Neighbour]:
    """The NEAR of `solved` that are nearest to the pose, then the SPREAD that are farthest from all chosen before.

    The distance of two cameras is that of their centres, where 1 is the median distance of the solved ones from their middle,
    plus their angle in radians: either moves the picture about as much.
    """
    if not solved:
        return []
    centres = np.stack([neighbour.pose.centre for neighbour in solved])
    unit = float(np.median(np.linalg.norm(centres - centres.mean(axis=0), axis=1))) or 1.0

    def apart(a: Pose, b: Pose) -> float:
        distance, degrees = pose_error(a, b)
        return distance / unit + float(np.radians(degrees))

    left = sorted(solved, key=lambda neighbour: apart(here, neighbour.pose))
    chosen, left = left[:NEAR], left[NEAR:]
    while left and len(chosen) < NEAR + SPREAD:
        far = max(left, key=lambda neighbour: min(apart(neighbour.pose, other.pose) for other in chosen))
        chosen.append(far)
        left.remove(far)
    return chosen


def _neighbour(scene: bpy.types.Scene, splat: bpy.types.Object, camera: bpy.types.Object) -> Neighbour | None:
    """None for a camera that the engine could not take as it stands (it has been made a panorama, say)."""
    try:
        return Neighbour(camera.name, camera_bridge.read_camera(scene, camera, splat).pose)
    except CameraError:
        return None
