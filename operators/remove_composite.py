"""Remove Composite: the scene is what it was before Set Up Composite."""

from __future__ import annotations

import bpy

from ..gssmc_addon.composite import setup
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_remove_composite(Idle, PlainOperator, bpy.types.Operator):
    """Take the composite out of the scene and put back every setting that it changed"""

    bl_idname = "gssmc.remove_composite"
    bl_label = "Remove Composite"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.gssmc.composite.is_set_up:
            cls.poll_message_set("No composite is set up in this scene; use Set Up Composite first")
            return False
        return super().poll(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        notes = setup.remove(context.scene)
        return self.done(context, " ".join([rpt_("The composite is removed; the scene is what it was."), *notes]))


classes = (GSSMC_OT_remove_composite,)
