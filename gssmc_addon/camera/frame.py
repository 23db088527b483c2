"""Cameras follow the render: when its shape changes, the lens of each camera of a photo is written anew for it.

A lens in millimetres means another focal length in pixels in a frame of another shape. Each camera keeps the frame that its
lens was written for, so nothing is lost while it waits; here it is brought up to date, before it is looked through or drawn.
"""

from __future__ import annotations

import bpy

from ..photo import image as photo_image
from . import bridge as camera_bridge
from . import channels as camera_channels


def is_stale(scene: bpy.types.Scene, data: bpy.types.Camera) -> bool:
    """Whether the lens was written for a frame of another shape than the render's. False for a camera set by hand."""
    props, render = data.gssmc, scene.render
    if not (props.frame_x and props.frame_y):
        return False
    pixel = render.pixel_aspect_x / render.pixel_aspect_y
    other_pixel = props.frame_pixel and abs(props.frame_pixel - pixel) > camera_bridge.SAME_PIXEL * pixel
    return bool(other_pixel) or (props.frame_x, props.frame_y) != (render.resolution_x, render.resolution_y)


def fit(scene: bpy.types.Scene, data: bpy.types.Camera) -> None:
    """Writes the lens for the render's frame; the camera of the photo stays the same. Keyframes of the lens go along.

    Left as it is: what cannot be written (a driver, a library), and what another scene shows in its own frame.
    """
    if not camera_channels.is_lens_writable(data) or _is_shown_elsewhere(scene, data):
        return
    size = photo_image.own_size(data)
    size = size if all(size) else (data.gssmc.frame_x, data.gssmc.frame_y)
    before = data.lens
    camera_bridge.move_to_render(scene, data, *size)
    camera_channels.scale_lens_keys(data, data.lens / before)


def fit_all(scene: bpy.types.Scene) -> None:
    """Brings every camera of the scene up to date."""
    for data in {obj.data for obj in scene.objects if obj.type == "CAMERA"}:
        if is_stale(scene, data):
            fit(scene, data)


def follow(scene: bpy.types.Scene) -> None:
    """Call this whenever the render's shape may have changed; it does nothing unless the scene's camera has the old one."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        return
    if is_stale(scene, camera.data):
        fit_all(scene)
    if camera.data.is_editable:
        camera_bridge.show_pixel(camera.data)  # Two cameras may show the same image.


def release(data: bpy.types.Camera) -> None:
    """Makes the camera one that was set by hand, with Blender's own behaviour when the resolution changes."""
    data.gssmc.frame_x = data.gssmc.frame_y = 0
    data.gssmc.frame_pixel = data.gssmc.photo_pixel = 0.0


def _is_shown_elsewhere(scene: bpy.types.Scene, data: bpy.types.Camera) -> bool:
    """Two scenes that look through one camera would take the lens from each other for ever."""
    others = (other for other in bpy.data.scenes if other != scene and other.camera and other.camera.data == data)
    return any(not is_stale(other, data) for other in others)


@bpy.app.handlers.persistent
def _after_update(scene: bpy.types.Scene, *_: object) -> None:
    follow(scene)


@bpy.app.handlers.persistent
def _before_render(scene: bpy.types.Scene, *_: object) -> None:
    fit_all(scene)  # Timeline markers may switch the camera during a render.


def register() -> None:
    bpy.app.handlers.depsgraph_update_post.append(_after_update)
    bpy.app.handlers.render_init.append(_before_render)


def unregister() -> None:
    bpy.app.handlers.render_init.remove(_before_render)
    bpy.app.handlers.depsgraph_update_post.remove(_after_update)
