"""Up Axis: another axis of the splat's file points up, after the import."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..gssmc_addon.camera import upright
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.splat import up_axis
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import iface_, rpt_


class GSSMC_OT_up_axis(PlainOperator, bpy.types.Operator):
    """Turn the splat so that another axis of its file points up; the cameras of its photos turn along with it"""

    bl_idname = "gssmc.up_axis"
    bl_label = "Up Axis"
    bl_options = {"UNDO"}

    __annotations__ = {
        "axis": EnumProperty(name="Up Axis", items=up_axis.AXIS_ITEMS, description="Which axis of the file points up"),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not splat_object.is_splat(context.scene.gssmc.splat):
            cls.poll_message_set("No splat is picked; import one, or pick it in the panel")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        splat = context.scene.gssmc.splat
        count = upright.change(context.scene, splat, self.axis)
        values = {"axis": iface_(up_axis.AXIS_WORDS[self.axis]), "count": count}
        if count == 1:
            return self.done(context, rpt_("{axis}: the splat was turned, and 1 camera with it.", **values))
        if count:
            return self.done(context, rpt_("{axis}: the splat was turned, and {count} cameras with it.", **values))
        return self.done(context, rpt_("{axis}: the splat was turned.", **values))


classes = (GSSMC_OT_up_axis,)
