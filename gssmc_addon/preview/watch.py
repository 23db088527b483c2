"""Takes the preview out of the viewport when it is no longer what the camera sees: the camera, its lens or the splat was moved.

Blender's handlers only ask for a look, which a timer takes: they run in the middle of updates, and while something is rendered.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...core.errors import GssmcError
from ..camera import bridge as camera_bridge
from ..camera.bridge import CameraCopy
from ..photo import image as photo_image
from ..plate.source import MOVING
from . import images as preview_images

VIEW = "gssmc_view"
DIGITS = 5
LATER_S = 1.0


def mark(camera: bpy.types.Object, copy: CameraCopy, image: bpy.types.Image) -> None:
    """Notes on the preview's pictures that they show what the camera saw as it was copied."""
    for picture in {image, preview_images.find("photo"), preview_images.find("render")}:
        if picture is not None:
            picture[VIEW] = _view(camera, copy)


def _view(camera: bpy.types.Object, copy: CameraCopy) -> str:
    """Pose in the splat, lens and photo in words; of a moving plate the frame too."""
    pose = (*copy.pose.R.ravel(), *copy.pose.t)
    lens = [value if isinstance(value, str) else round(float(value), DIGITS) for value in vars(copy.lens).values()]
    photo = photo_image.camera_photo(camera)
    frame = bpy.context.scene.frame_current if photo and photo.source in MOVING else 0
    shown = photo.session_uid if photo else 0
    return repr(([round(float(x), DIGITS) + 0.0 for x in pose], lens, copy.dist, copy.frame, copy.photo_pixel, shown, frame))


def take_away_when_stale() -> None:
    """Looks at the viewport's preview, and takes it away when its camera sees something else now."""
    data = preview_images.in_viewport()
    if data is None:
        return
    scene = bpy.context.scene
    camera = next((obj for obj in scene.objects if obj.data == data), None)
    image = next(slot.image for slot in data.background_images if preview_images.is_ours(slot.image))
    try:
        copy = camera_bridge.read_camera(scene, camera, scene.gssmc.splat) if camera and scene.gssmc.splat else None
    except GssmcError:
        copy = None
    if camera is None or copy is None or image.get(VIEW) != _view(camera, copy):
        preview_images.show_in_viewport(None, None)


def _look() -> float | None:
    if bpy.app.is_job_running("RENDER"):
        return LATER_S
    take_away_when_stale()
    return None


@bpy.app.handlers.persistent
def _changed(*_: Any) -> None:
    if not bpy.app.background and not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=0.0)


_HANDLERS = ("depsgraph_update_post", "frame_change_post", "undo_post", "redo_post")


def register() -> None:
    for kind in _HANDLERS:
        getattr(bpy.app.handlers, kind).append(_changed)


def unregister() -> None:
    for kind in _HANDLERS:
        getattr(bpy.app.handlers, kind).remove(_changed)
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
