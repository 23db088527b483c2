"""Next Weak Frame: goes to the next frame of a plate that is not held well."""

from __future__ import annotations

import bpy
from bpy.props import IntProperty

from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_weak_frame(bpy.types.Operator):
    """Go to the next or previous frame of the plate that is weak, bad or lost"""

    bl_idname = "gssmc.weak_frame"
    bl_label = "Next Weak Frame"

    __annotations__ = {
        "step": IntProperty(name="Step", default=1, description="1 for the next one, -1 for the previous one"),
    }

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, context.scene.camera
        words = camera.data.gssmc.weak_frames.split() if camera and camera.type == "CAMERA" else []
        frames = sorted(int(word) for word in words)
        if not frames:
            self.report({"INFO"}, rpt_("No frame of the camera's plate is weak."))
            return {"CANCELLED"}
        now = scene.frame_current
        ahead = [f for f in frames if f > now] if self.step > 0 else [f for f in reversed(frames) if f < now]
        scene.frame_set(ahead[0] if ahead else frames[0 if self.step > 0 else -1])
        return {"FINISHED"}


classes = (GSSMC_OT_weak_frame,)
