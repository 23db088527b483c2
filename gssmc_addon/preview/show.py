"""What the finished preview needs to be seen, and the sentence on it."""

from __future__ import annotations

import bpy

from ..support.texts import rpt_
from .job import Preview


def look_through(context: bpy.types.Context, camera: bpy.types.Object) -> None:
    """Turns the viewport at hand to the scene's camera, where none looks through it yet: else the picture is nowhere to see."""
    areas = (area for window in context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    spaces = [area.spaces.active for area in areas]
    looking = any(space.region_3d.view_perspective == "CAMERA" and space.camera == camera for space in spaces)
    if spaces and not looking and camera == context.scene.camera:
        here = context.space_data if context.area and context.area.type == "VIEW_3D" else spaces[0]
        here.region_3d.view_perspective = "CAMERA"


def told(camera: bpy.types.Object, result: Preview) -> str:
    """What the preview shows, as a sentence."""
    if not result.matches:
        return rpt_('Preview of "{name}".', name=camera.name)
    good = result.matches.good
    if len(good) == 1:
        return rpt_(
            '"{name}": {good} of 1 match sits at the same place in photo and render.', name=camera.name, good=good.sum()
        )
    return rpt_(
        '"{name}": {good} of {count} matches sit at the same place in photo and render.',
        name=camera.name,
        good=good.sum(),
        count=len(good),
    )
