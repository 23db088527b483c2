"""Set Up Composite and Remove Composite in the sidebar."""

from __future__ import annotations

import bpy

from ..refine import panel as panels
from ..support.texts import iface_


class GSSMC_PT_composite(panels._Sidebar, bpy.types.Panel):
    bl_label = "Composite"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        kept = context.scene.gssmc.composite
        column = self.layout.column(align=True)
        row = column.row(align=True)
        row.operator("gssmc.set_up_composite", icon="NODE_COMPOSITING")
        row.operator_menu_enum("gssmc.set_up_composite", "lens", text="", icon="DOWNARROW_HLT")
        column.operator("gssmc.remove_composite", icon="LOOP_BACK")
        column = self.layout.column(align=True)
        column.operator("gssmc.render_splat", icon="RENDER_ANIMATION")
        if kept.frames_size[0]:
            column.operator("gssmc.set_up_composite", text="Set Up With Splat Behind", icon="NODE_COMPOSITING").behind = "SPLAT"
        if kept.is_set_up and kept.camera != context.scene.camera:
            text = iface_(
                'It is set up for "{name}"; set it up again for this camera.', name=kept.camera.name if kept.camera else "?"
            )
            panels.draw_text(self.layout, context, text, icon="INFO")
        elif kept.is_set_up and kept.engine != context.scene.render.engine:
            panels.draw_text(
                self.layout, context, iface_("It is set up for another render engine; set it up again."), icon="INFO"
            )


classes = (GSSMC_PT_composite,)
