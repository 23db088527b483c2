"""The preview in the sidebar."""

from __future__ import annotations

import bpy

from ..jobs import slot
from ..photo import image as photo_image
from ..refine import panel as panels
from ..support.texts import iface_
from . import images as preview_images
from . import options as preview_options


class GSSMC_PT_preview(panels._Sidebar, bpy.types.Panel):
    bl_label = "See the Fit"
    bl_parent_id = "GSSMC_PT_main"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        return camera is not None and camera.type == "CAMERA" and photo_image.camera_photo(camera) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, own = self.layout, context.window_manager.gssmc.preview
        column = layout.column(align=True)
        column.row(align=True).prop(context.scene.gssmc, "look", expand=True)
        column.prop(context.scene.gssmc, "photo_opacity", slider=True)
        column = layout.column(align=True)
        column.enabled = not slot.active()  # A job must end first, so that the options always agree with the picture.
        column.prop(own, "style", text="")
        if own.style == "WIPE":
            row = column.row(align=True)
            row.prop(own, "position", slider=True)
            row.operator("gssmc.drag_wipe", text="", icon="ARROW_LEFTRIGHT")
        if own.style in preview_options.IN_VIEWPORT:
            layout.prop(own, "background")
        elif not any(preview_images.editors()):
            panels.draw_text(layout, context, iface_("This style shows in an Image Editor; open one, or choose another style."))
        if own.flicker:
            layout.prop(own, "flicker", toggle=True, icon="PAUSE")
        layout.operator("gssmc.preview", icon="IMAGE_RGB")


classes = (GSSMC_PT_preview,)
