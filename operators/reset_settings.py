"""Reset Settings: gives the refinement's values their defaults."""

from __future__ import annotations

import bpy

from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_reset_settings(PlainOperator, bpy.types.Operator):
    """Give all values of the refinement back their own defaults, which are those of the quality Normal"""

    bl_idname = "gssmc.reset_settings"
    bl_label = "Reset"
    bl_options = {"UNDO"}

    def run(self, context: bpy.types.Context) -> set[str]:
        settings_props.reset(context.scene.gssmc)
        return self.done(context, rpt_("All values of the refinement have their defaults again."))


classes = (GSSMC_OT_reset_settings,)
