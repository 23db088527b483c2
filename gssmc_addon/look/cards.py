"""Picture cards: every photo of the list, small, in the frustum of its camera, where the viewport shows all cameras.

A double click on a card looks through its camera.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ..photo import image as photo_image
from ..photo import list as photo_list

log = logging.getLogger(__name__)
CORNERS_UV = ((1.0, 1.0), (1.0, 0.0), (0.0, 0.0), (0.0, 1.0))  # in the order of Camera.view_frame
TRIANGLES = ((0, 1, 2), (2, 3, 0))
Card = tuple[bpy.types.Object, list[Vector]]


def cards(context: bpy.types.Context) -> Iterator[Card]:
    """The cameras whose cards the viewport shows, each with the corners of its card in the world."""
    scene, space = context.scene, context.space_data
    if not scene.gssmc.show_all_cameras or context.region_data.view_perspective == "CAMERA":
        return
    for camera in photo_list.cameras(scene):
        if photo_image.camera_photo(camera) and camera.visible_get(view_layer=context.view_layer, viewport=space):
            frame = camera.data.view_frame(scene=scene)
            yield camera, [camera.matrix_world @ (corner * camera.data.display_size) for corner in frame]


def card_at(context: bpy.types.Context, mouse: tuple[int, int]) -> bpy.types.Object | None:
    """The camera of the nearest card below the mouse (pixels of the region); None where there is none."""
    found: list[tuple[float, bpy.types.Object]] = []
    eye = context.region_data.view_matrix.inverted().translation
    for camera, corners in cards(context):
        seen = [location_3d_to_region_2d(context.region, context.region_data, corner) for corner in corners]
        if None not in seen and is_inside(np.array(seen), np.array(mouse, float)):
            found.append(((camera.matrix_world.translation - eye).length, camera))
    return min(found, key=lambda one: one[0])[1] if found else None


def is_inside(corners: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point lies in the convex quadrangle with these `corners` (4, 2), in either order round."""
    edges, to_point = np.roll(corners, -1, axis=0) - corners, point - corners
    sides = edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0]
    return bool((sides >= 0).all() or (sides <= 0).all())


class _Cards:
    """The draw handler, and the cards' textures by image."""

    def __init__(self) -> None:
        self.handle: Any = None
        self.textures: dict[int, gpu.types.GPUTexture] = {}


_cards = _Cards()


def _texture(image: bpy.types.Image) -> gpu.types.GPUTexture | None:
    """The image's thumbnail; None where there is none yet."""
    uid = image.session_uid
    if uid not in _cards.textures:
        preview = image.preview
        if preview is None or not all(preview.image_size):
            return None
        width, height = preview.image_size
        pixels = np.empty(4 * width * height, np.float32)
        preview.image_pixels_float.foreach_get(pixels)
        pixels = pixels.reshape(height, width, 4)
        filled = np.argwhere(pixels[..., 3] > 0)
        if not len(filled):
            return None
        (top, left), (bottom, right) = filled.min(0), filled.max(0) + 1  # The thumbnail is square, with empty margins.
        part = np.ascontiguousarray(pixels[top:bottom, left:right])
        buffer = gpu.types.Buffer("FLOAT", part.size, part.ravel())
        _cards.textures[uid] = gpu.types.GPUTexture((right - left, bottom - top), format="RGBA32F", data=buffer)
    return _cards.textures[uid]


def _draw() -> None:
    try:
        _draw_cards(bpy.context)
    except Exception:  # A driver's refusal must not stop the drawing of the rest.
        log.exception("The cards of the photos cannot be drawn")
        bpy.app.timers.register(unregister, first_interval=0.0)


def _draw_cards(context: bpy.types.Context) -> None:
    shown = list(cards(context))
    if not shown:
        return
    shader = gpu.shader.from_builtin("IMAGE")
    gpu.state.depth_test_set("LESS_EQUAL")
    for camera, corners in shown:
        image = photo_image.camera_photo(camera)
        picture = _texture(image) if image else None
        if picture is None:
            continue
        batch = batch_for_shader(shader, "TRIS", {"pos": corners, "texCoord": CORNERS_UV}, indices=TRIANGLES)
        shader.bind()
        shader.uniform_sampler("image", picture)
        batch.draw(shader)
    gpu.state.depth_test_set("NONE")


def register() -> None:
    if not bpy.app.background:
        _cards.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    if _cards.handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_cards.handle, "WINDOW")
    _cards.handle = None
    _cards.textures.clear()
