"""Pictures before the scene: a camera's background images with depth Front, which lie over everything seen through the camera.

Blender has drawn them already when splats are drawn, hence a splat is laid over the viewport with the pictures on it. What
Blender shows is worked out as in its overlay: the picture is fitted to the camera's frame, scaled, turned and moved in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

COMP = "COMP"  # the scene's look in which photos lie behind
MOST = 4  # as many as the shader takes
STILL = ("FILE", "GENERATED")  # Of all other sources only Blender knows which frame is shown.


@dataclass(frozen=True)
class FrontPicture:
    """A picture of opacity `alpha`. `place` (2, 3) takes a point of the region (0..1 across, 0..1 up, 1) to the picture's own
    0..1, which it lies within. `image`: None where its pixels are only to be had from what Blender has drawn.
    """

    image: bpy.types.Image | None
    place: np.ndarray
    alpha: float


def front_pictures(context: bpy.types.Context) -> list[FrontPicture]:
    """The viewport's pictures from the lowest to the uppermost; of very many only the uppermost.

    In the look Comp the photo behind the scene counts as one: laid over the splat at full opacity, the splat shows the photo
    where it hides CG.
    """
    space, region = context.space_data, context.region_data
    camera = space.camera if region.view_perspective == "CAMERA" else None
    if camera is None or camera.type != "CAMERA" or not camera.data.show_background_images or not space.overlay.show_overlays:
        return []
    border = border_of(context.scene, camera.data, region.window_matrix)
    comp = context.scene.gssmc.look == COMP
    slots = [slot for slot in camera.data.background_images if slot.show_background_image and (comp or _is_front(slot))]
    found = [_picture(slot, border, (context.region.width, context.region.height)) for slot in slots]
    # Behind the scene, the picture's pixels must be known: what the viewport shows has CG before them.
    return [picture for picture in found if picture is not None and (picture.image or not comp)][-MOST:]


def across_picture(context: bpy.types.Context, mouse: tuple[int, int]) -> float | None:
    """Where the mouse, in pixels of the window, is across the picture that lies on the camera's view there, 0 at its left to 1;
    None where there is none.
    """
    for area in (area for area in context.screen.areas if area.type == "VIEW_3D"):
        region, space = next(r for r in area.regions if r.type == "WINDOW"), area.spaces.active
        at = np.array([mouse[0] - region.x, mouse[1] - region.y]) / (region.width, region.height)
        camera = space.camera if space.region_3d.view_perspective == "CAMERA" else None
        if not ((at >= 0) & (at <= 1)).all() or camera is None or camera.type != "CAMERA":
            continue
        border = border_of(context.scene, camera.data, space.region_3d.window_matrix)
        slots = [slot for slot in camera.data.background_images if slot.show_background_image]
        pictures = [_picture(slot, border, (region.width, region.height)) for slot in slots]
        place = next((picture.place for picture in reversed(pictures) if picture), None)
        return None if place is None else float(np.clip(place[0] @ (*at, 1.0), 0.0, 1.0))
    return None


def _is_front(slot: bpy.types.CameraBackgroundImage) -> bool:
    return slot.display_depth == "FRONT"


def border_of(scene: bpy.types.Scene, data: bpy.types.Camera, projection: Matrix) -> np.ndarray:
    """Lower left and upper right corner (2, 2) of the camera's frame, in 0..1 of the region."""
    corners = []
    for corner in data.view_frame(scene=scene):
        seen = projection @ Vector((*corner, 1.0))
        corners.append((0.5 + 0.5 * seen.x / seen.w, 0.5 + 0.5 * seen.y / seen.w))
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)])


def _picture(slot: bpy.types.CameraBackgroundImage, border: np.ndarray, region: tuple[int, int]) -> FrontPicture | None:
    """None when the slot shows nothing."""
    source = slot.image if slot.source == "IMAGE" else slot.clip
    if source is None or not all(source.size) or slot.alpha <= 0:
        return None
    across, up = source.size[0] * source.display_aspect[0], source.size[1] * source.display_aspect[1]
    still = slot.image if slot.source == "IMAGE" and source.source in STILL else None
    return FrontPicture(still, place_of(slot, across / up, border, region), slot.alpha)


def place_of(slot: bpy.types.CameraBackgroundImage, aspect: float, border: np.ndarray, region: tuple[int, int]) -> np.ndarray:
    """`FrontPicture.place` of a picture of the given `aspect` in a frame with `border`, of a `region` in pixels.

    As Blender draws it (measured in its window): the offset counts in widths of the frame, and upwards in heights of the
    picture that is as wide as the frame.
    """
    size = (border[1] - border[0]) * region
    fit = np.array([1.0, 1.0])
    wider = aspect * size[1] / size[0]  # than the frame
    if slot.frame_method == "FIT":
        fit = np.array([min(1.0, wider), min(1.0, 1 / wider)])
    elif slot.frame_method == "CROP":
        fit = np.array([max(1.0, wider), max(1.0, 1 / wider)])
    cos, sin = math.cos(slot.rotation), math.sin(slot.rotation)
    flips = np.array([-1.0 if slot.use_flip_x else 1.0, -1.0 if slot.use_flip_y else 1.0])
    turn, square = np.array([[cos, sin], [-sin, cos]]), np.array([size[0] / size[1], 1.0])
    linear = np.diag(1 / square) @ turn @ np.diag(square * fit * flips * slot.scale)
    inverse = np.linalg.inv(linear if abs(np.linalg.det(linear)) > 1e-12 else np.eye(2) * 1e-6)
    # From the region to the frame's -1..1, to the picture's -1..1, to the picture's 0..1.
    to_frame = np.diag(2 / (border[1] - border[0]))
    shift = -to_frame @ border.mean(axis=0) - 2 * np.array(slot.offset) * (1.0, square[0] / aspect)
    return np.column_stack([0.5 * inverse @ to_frame, 0.5 + 0.5 * inverse @ shift])
