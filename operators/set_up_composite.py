"""Set Up Composite: F12 renders CG into the camera's photo or plate."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..gssmc_addon.composite import setup
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.support.operator_parts import PlainOperator


class GSSMC_OT_set_up_composite(Idle, PlainOperator, bpy.types.Operator):
    """Make F12 give the finished picture: CG over the photo, cut off and shaded by the place, bent by the photo's lens"""

    bl_idname = "gssmc.set_up_composite"
    bl_label = "Set Up Composite"
    bl_options = {"UNDO"}

    __annotations__ = {
        "lens": EnumProperty(name="Lens", description="Where the lens distortion goes", items=setup.LENS_ITEMS),
        "behind": EnumProperty(name="Behind", description="What lies behind the CG", items=setup.BEHIND_ITEMS),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        said, *notes = setup.set_up(context.scene, self.lens, self.behind)
        return self.done(context, " ".join([said, *notes]), line=" ".join(notes))


classes = (GSSMC_OT_set_up_composite,)
