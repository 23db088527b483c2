"""Floor and scale of the splat in the sidebar."""

from __future__ import annotations

import bpy

from ..refine import panel as panels
from ..splat import object as splat_object


class GSSMC_PT_floor(panels._Sidebar, bpy.types.Panel):
    bl_label = "Floor and Scale"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return splat_object.is_splat(context.scene.gssmc.splat)

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.label(text="Set Floor")
        row = column.row(align=True)
        row.operator("gssmc.set_floor", text="Three Clicks", icon="RESTRICT_SELECT_OFF").method = "POINTS"
        row.operator("gssmc.set_floor", text="Automatic", icon="SHADERFX").method = "AUTO"
        self.layout.operator("gssmc.set_scale", icon="DRIVER_DISTANCE")


classes = (GSSMC_PT_floor,)
