"""Look Through Card: a double click on a photo's card in the viewport."""

from __future__ import annotations

import bpy

from ..gssmc_addon.look import cards
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_look_through_card(bpy.types.Operator):
    """Look through the camera whose photo is shown below the mouse"""

    bl_idname = "gssmc.look_through_card"
    bl_label = "Look Through Card"
    bl_options = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, rpt_("A card is chosen with the mouse; in a script set the scene's photo_index."))
        return {"CANCELLED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """What is no card is left to Blender."""
        if context.area is None or context.area.type != "VIEW_3D" or context.region.type != "WINDOW":
            return {"PASS_THROUGH"}
        camera = cards.card_at(context, (event.mouse_region_x, event.mouse_region_y))
        if camera is None:
            return {"PASS_THROUGH"}
        photo_list.pick(context.scene, camera)
        return {"FINISHED"}


classes = (GSSMC_OT_look_through_card,)
