"""The cameras that a proxy is made from, copied out of Blender, in the coordinates of the splat."""

from __future__ import annotations

import bpy

from ...core.errors import ProxyError
from ...core.geometry.camera import Camera
from ..camera import bridge as camera_bridge
from ..camera import record as camera_record
from ..camera import solution as camera_solution
from ..photo import image as photo_image
from ..photo import list as photo_list
from ..support.texts import rpt_

SOLVED = ("TRUSTED", "CHECK", "PINNED")


def cameras_of(
    scene: bpy.types.Scene, splat: bpy.types.Object, camera: bpy.types.Object | None, which: str, step: int
) -> list[Camera]:
    """`which` as in options.CAMERAS. Raises GssmcError, with what to do, where there is none."""
    if which == "PHOTOS":
        solved = [one for one in photo_list.cameras(scene) if camera_solution.verdict(scene, one) in SOLVED]
        if not solved:
            raise ProxyError(rpt_("No photo of the list has a camera that holds; use Find All or Refine All first."))
        return [_copied(scene, splat, one) for one in solved]
    if camera is None or camera.type != "CAMERA":
        raise ProxyError(rpt_("The scene has no camera to make a proxy from; add a photo, or pick a camera."))
    return _of_plate(camera, step) if which == "PLATE" else [_copied(scene, splat, camera)]


def doubts(scene: bpy.types.Scene, camera: bpy.types.Object | None, which: str) -> str:
    """Sentences on cameras that `cameras_of` leaves out, or takes although they are to be checked or failed; "" on none."""
    if which != "PHOTOS":
        verdict = camera_solution.verdict(scene, camera) if camera is not None else ""
        name = camera.name if camera is not None else ""
        if verdict == "FAILED":
            return rpt_('"{name}" failed to be refined; the mesh is what it sees from where it stands.', name=name)
        return (
            rpt_('"{name}" should be checked by eye; a wrong camera bends the mesh.', name=name) if verdict == "CHECK" else ""
        )
    verdicts = [camera_solution.verdict(scene, one) for one in photo_list.cameras(scene)]
    out, checked = sum(verdict not in SOLVED for verdict in verdicts), verdicts.count("CHECK")
    told = [
        rpt_("Left out: photos without a camera that holds, {count} of {all}.", count=out, all=len(verdicts)) if out else "",
        rpt_("Cameras that should be checked by eye: {count}; a wrong one bends the mesh.", count=checked) if checked else "",
    ]
    return " ".join(sentence for sentence in told if sentence)


def _copied(scene: bpy.types.Scene, splat: bpy.types.Object, camera: bpy.types.Object) -> Camera:
    """As the camera stands and looks now, at the size of its photo, or of the render where it has none. Its file is the
    camera's name.
    """
    size = photo_image.own_size(camera.data)
    width, height = size if all(size) else camera_bridge.lens_frame(scene, camera.data)
    found = camera_bridge.read_camera(scene, camera, splat).at_size(width, height)
    return Camera(found.intrinsics, found.pose, camera.name)


def _of_plate(camera: bpy.types.Object, step: int) -> list[Camera]:
    """Every `step`th frame that was solved, the first and the last among them."""
    solution = camera_record.read(camera.data)
    if solution is None or not solution.path:
        raise ProxyError(rpt_('The plate of "{name}" is not solved; use Track Every Frame first.', name=camera.name))
    frames = sorted(solution.path)
    chosen = sorted({*frames[::step], frames[-1]})
    return [Camera(c.intrinsics, c.pose, f"{camera.name} {f}") for f, c in ((f, solution.path[f]) for f in chosen)]
