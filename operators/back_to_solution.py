"""Back to Solution: the camera becomes what it was solved to be."""

from __future__ import annotations

import bpy

from ..gssmc_addon.camera import solution as camera_solution
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_back_to_solution(Idle, PlainOperator, bpy.types.Operator):
    """Put the camera, its lens and its photo back to what Refine last solved them to be"""

    bl_idname = "gssmc.back_to_solution"
    bl_label = "Back to Solution"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        if camera is None or camera.type != "CAMERA":
            cls.poll_message_set("The scene has no camera; undo its removal, or pick another photo on the list")
            return False
        if not camera.data.gssmc.solution:
            cls.poll_message_set("The scene camera was never solved; use Find Camera or Refine Camera")
            return False
        return super().poll(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        camera = context.scene.camera
        keyed = camera_solution.put_back(context.scene, camera)
        photo_camera.stop_moving_with_view()
        back = rpt_('"{name}" is back where it was solved.', name=camera.name)
        return self.done(context, f"{back} {keyed}".strip())


classes = (GSSMC_OT_back_to_solution,)
