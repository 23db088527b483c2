"""The panel's style, wipe or place of the preview was changed: what is shown follows at once.

Where photo and render of the view are kept, only the picture is made anew. Else, and for the matches, the preview runs again,
as if its button had been pressed; not before it was pressed for the first time.
"""

from __future__ import annotations

import contextlib

import bpy

from ...core.errors import GssmcError
from ..camera import bridge as camera_bridge
from ..jobs import slot
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..splat import object as splat_object
from . import images as preview_images
from . import job as preview_job
from . import options as preview_options
from . import watch

BUSY_S = 0.5


def style_changed(own: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Another style, or the viewport shows it now."""
    own.flicker = False
    if preview_images.find("render") is None:
        return  # There is no preview yet; the button makes the first one.
    if own.style not in preview_options.IN_VIEWPORT:
        preview_images.show_in_viewport(None, None)  # The picture there belongs to another style.
    shown = own.style != "MATCHES" and _recompose(own, context, any_content=False)
    if not shown and not bpy.app.background and not bpy.app.timers.is_registered(_press):
        bpy.app.timers.register(_press, first_interval=0.0)


def position_changed(own: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The wipe's line is dragged: the picture follows, without a look at the splat for each step of the mouse."""
    if own.style == "WIPE":
        _recompose(own, context, any_content=True)


def _press() -> float | None:
    """Runs the preview; an operator cannot be started in the middle of a property's change. A running job is waited for."""
    window = next(iter(bpy.context.window_manager.windows), None)
    if window is None:
        return None
    if slot.active():
        return BUSY_S
    # The operator has reported the reason, also in the panel.
    with bpy.context.temp_override(window=window), contextlib.suppress(RuntimeError):
        bpy.ops.gssmc.preview("INVOKE_DEFAULT")
    return None


def _recompose(own: bpy.types.PropertyGroup, context: bpy.types.Context, any_content: bool) -> bool:
    """Shows the style made of the kept pair; False when there is none of this view."""
    camera, splat = context.scene.camera, context.scene.gssmc.splat
    photo = photo_image.camera_photo(camera) if camera and camera.type == "CAMERA" else None
    if photo is None or not splat_object.is_splat(splat):
        return False
    options = preview_job.options_of(own)
    try:
        copy = camera_bridge.read_camera(context.scene, camera, splat)
        source = plate_source.source_at(context.scene, camera, photo)
        content = "" if any_content else preview_job.content_key(splat)
    except (GssmcError, KeyError):
        return False  # The button reports what is wrong.
    kept = preview_images.packed_pair(preview_images.Key(preview_job.view_key(copy, source, splat, options), content))
    pair = preview_images.unpack_pair(kept) if kept else None
    if pair is None:
        return False
    picture = preview_images.find("render") if own.style == "FLICKER" else None
    if picture is None:
        picture = preview_images.put_picture(preview_job.compose(options, pair))
    context.window_manager.gssmc.tell("")  # The message belonged to the previous style.
    shown = preview_images.show(picture)
    in_viewport = own.background and own.style in preview_options.IN_VIEWPORT
    if in_viewport:
        watch.mark(camera, copy, picture)
        preview_images.show_in_viewport(camera.data, picture)
    own.flicker = own.style == "FLICKER" and (shown or in_viewport)
    return True
