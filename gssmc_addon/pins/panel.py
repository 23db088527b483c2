"""The pins of the scene's camera in the sidebar."""

from __future__ import annotations

import bpy

from ..photo import image as photo_image
from ..refine import panel as panels
from ..support.texts import iface_
from . import state as pin_state


class GSSMC_PT_pins(panels._Sidebar, bpy.types.Panel):
    bl_label = "Pins"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        return camera is not None and camera.type == "CAMERA" and photo_image.camera_photo(camera) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, own, data = self.layout, context.scene.gssmc, context.scene.camera.data
        shown = pin_state.numbers(context.scene, data)
        layout.operator("gssmc.place_by_pins", icon="PINNED")
        if not shown:
            panels.draw_text(layout, context, iface_("Drag points of the splat to where the photo shows them."))
            return
        column = layout.column(align=True)
        for number, index in enumerate(shown, 1):
            row, pin = column.row(align=True), data.gssmc.pins[index]
            said = iface_("{number}: {error:.1f} px", number=number, error=pin.error_px)
            row.label(text=said if pin.error_px >= 0 else iface_("{number}: not placed", number=number), translate=False)
            row.prop(pin, "weight", text="")
            row.operator("gssmc.remove_pin", text="", icon="X").index = index
        layout.operator("gssmc.solve_pins", icon="CON_CAMERASOLVER")
        column = layout.column(align=True)
        column.prop(own, "hold_pins")
        column.prop(own, "show_pins")


classes = (GSSMC_PT_pins,)
