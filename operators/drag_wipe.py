"""Drag the Line: the wipe's line between photo and render follows the mouse."""

from __future__ import annotations

import bpy

from ..gssmc_addon.preview import images as preview_images
from ..gssmc_addon.support.texts import rpt_
from ..gssmc_addon.viewport import front


class GSSMC_OT_drag_wipe(bpy.types.Operator):
    """Move the line between photo and render with the mouse in the viewport; a click sets it, Esc puts it back"""

    bl_idname = "gssmc.drag_wipe"
    bl_label = "Drag the Line"
    bl_options = {"INTERNAL"}

    _before = 0.5

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.window_manager.gssmc.preview.style != "WIPE" or preview_images.find("render") is None:
            cls.poll_message_set("There is no wipe; choose the style Wipe and press Preview")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, rpt_("The line is dragged with the mouse; in a script set the preview's position."))
        return {"CANCELLED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._before = context.window_manager.gssmc.preview.position
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(rpt_("Move the mouse: the line follows    Click: set    Esc: back"))
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        own = context.window_manager.gssmc.preview
        if event.type == "MOUSEMOVE":
            place = front.across_picture(context, (event.mouse_x, event.mouse_y))
            if place is not None:
                own.position = place
        elif event.type in ("LEFTMOUSE", "RET", "NUMPAD_ENTER") and event.value == "PRESS":
            context.workspace.status_text_set(None)
            return {"FINISHED"}
        elif event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            own.position = self._before
            context.workspace.status_text_set(None)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}


classes = (GSSMC_OT_drag_wipe,)
