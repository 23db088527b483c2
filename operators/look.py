"""Align or Comp: the other look of the viewport, on one key."""

from __future__ import annotations

import bpy

from ..gssmc_addon.look import looks
from ..gssmc_addon.photo import image as photo_image


class GSSMC_OT_look(bpy.types.Operator):
    """Change between Align (photo before the splat) and Comp (photo behind, CG solid, hidden where the splat lies before it)"""

    bl_idname = "gssmc.look"
    bl_label = "Align or Comp"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        if camera is None or camera.type != "CAMERA" or photo_image.camera_photo(camera) is None:
            cls.poll_message_set("The scene camera has no photo; use Add Photo, or pick another one on the list")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        own = context.scene.gssmc
        own.look = looks.ALIGN if own.look == looks.COMP else looks.COMP
        return {"FINISHED"}


classes = (GSSMC_OT_look,)
