"""Align and Comp: the two looks of a viewport through a photo's camera, changed by one key.

Align shows the photo half-transparent before the splat, to judge the fit. Comp shows what the shot will be: the photo behind,
CG as it stands, cut off by the splat where that lies before it, and no grid and no helpers.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator

import bpy

from ..photo import image as photo_image
from ..support.texts import n_

log = logging.getLogger(__name__)
ALIGN, COMP = "ALIGN", "COMP"
ITEMS = (
    (ALIGN, n_("Align"), n_("The photo before the splat, as opaque as Photo Opacity says")),
    (COMP, n_("Comp"), n_("The photo behind, CG solid, hidden where the splat lies before it; grid and helpers off")),
)
# What of a viewport's overlays would lie over the picture. The overlays themselves stay on, for the photo is one of them.
HELPERS = (
    "show_floor",
    "show_ortho_grid",
    "show_axis_x",
    "show_axis_y",
    "show_axis_z",
    "show_cursor",
    "show_extras",
    "show_relationship_lines",
    "show_outline_selected",
    "show_object_origins",
    "show_text",
    "show_stats",
)
# Where a screen keeps what was hidden of its viewports. The scene would lose it by an undo, which does not show them again.
KEPT = "gssmc_hidden_helpers"
Kept = dict[str, dict[str, bool]]


def apply(scene: bpy.types.Scene) -> None:
    """Gives every photo and every viewport the scene's look."""
    for camera in (obj for obj in scene.objects if obj.type == "CAMERA"):
        show_photo(scene, camera)
    settle(scene)


def show_photo(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Lays the camera's photo before or behind what it sees, as the scene's look says."""
    data, comp = camera.data, scene.gssmc.look == COMP
    pictures = [image for image in (photo_image.camera_photo(camera), data.gssmc.undistorted) if image]
    for slot in data.background_images:
        if slot.image in pictures or (slot.source == "MOVIE_CLIP" and slot.clip):
            slot.display_depth = "BACK" if comp else "FRONT"
            slot.alpha = 1.0 if comp else scene.gssmc.photo_opacity


def settle(scene: bpy.types.Scene) -> None:
    """The viewports as the scene's look says: undo takes a look back, and leaves the viewports as they are."""
    (_hide_helpers if scene.gssmc.look == COMP else _show_helpers)()


def _spaces(screen: bpy.types.Screen) -> Iterator[tuple[str, bpy.types.SpaceView3D]]:
    """Every 3D viewport of the screen, with a name that stays while the layout does."""
    for number, area in enumerate(screen.areas):
        for space in (space for space in area.spaces if space.type == "VIEW_3D"):
            yield str(number), space


def _hide_helpers() -> None:
    for screen in bpy.data.screens:
        kept: Kept = json.loads(screen.get(KEPT, "{}"))
        for name, space in _spaces(screen):
            if name not in kept:  # Else it is hidden already, and what it was is known.
                kept[name] = {helper: getattr(space.overlay, helper) for helper in HELPERS if hasattr(space.overlay, helper)}
            for helper in kept[name]:
                setattr(space.overlay, helper, False)
        if kept:
            screen[KEPT] = json.dumps(kept)


def _show_helpers() -> None:
    for screen in bpy.data.screens:
        kept: Kept = json.loads(screen.get(KEPT, "{}"))
        for name, space in _spaces(screen):
            for helper, value in kept.get(name, {}).items():
                setattr(space.overlay, helper, value)
        if KEPT in screen:
            del screen[KEPT]
