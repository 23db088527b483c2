"""Cancel the running refinement."""

import bpy

from ..gssmc_addon.jobs import slot as jobs


class GSSMC_OT_cancel(bpy.types.Operator):
    """Stop what is running; a camera that is not done stays as it is"""

    bl_idname = "gssmc.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context):
        return jobs.active() is not None

    def execute(self, context):
        jobs.active().cancel()  # the modal operator notices at its next tick
        return {"FINISHED"}


classes = (GSSMC_OT_cancel,)
