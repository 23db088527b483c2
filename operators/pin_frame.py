"""Pin Frame: the user's own camera at a frame of a plate, which tracking holds."""

from __future__ import annotations

import bpy

from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.plate.options import OfPlate
from ..gssmc_addon.plate.track import pins
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_pin_frame(OfPlate, Idle, PlainOperator, bpy.types.Operator):
    """Keep the camera of this frame as it stands: tracking the plate holds it exactly. Once more lets it go"""

    bl_idname = "gssmc.pin_frame"
    bl_label = "Pin This Frame"
    bl_options = {"UNDO"}

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        pinned, values = pins.toggle(scene, scene.camera), {"frame": scene.frame_current, "camera": scene.camera.name}
        if pinned:
            return self.done(context, rpt_('Frame {frame} of "{camera}" is pinned; tracking keeps its camera.', **values))
        return self.done(context, rpt_('Frame {frame} of "{camera}" is no longer pinned.', **values))


classes = (GSSMC_OT_pin_frame,)
