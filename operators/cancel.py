"""Cancel the running refinement."""

from __future__ import annotations

import bpy

from ..gssmc_addon.jobs import slot


class GSSMC_OT_cancel(bpy.types.Operator):
    """Stop what is running; a camera that is not done stays as it is"""

    bl_idname = "gssmc.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return slot.active() is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        job = slot.active()
        if job is not None:
            job.cancel()  # The modal operator notices it at its next tick.
        return {"FINISHED"}


classes = (GSSMC_OT_cancel,)
