"""Remove Pin: takes a pin, or all of them, from the scene's camera; the camera stays where it is."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, IntProperty

from ..core.errors import RefineError
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.pins import state
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_remove_pin(Idle, PlainOperator, bpy.types.Operator):
    """Remove a pin of the scene's camera, which stays where it is"""

    bl_idname = "gssmc.remove_pin"
    bl_label = "Remove Pin"
    bl_options = {"UNDO"}

    __annotations__ = {
        "index": IntProperty(name="Number", default=-1, min=-1, description="Which pin, from 0; -1: the last one"),
        "all": BoolProperty(name="All", default=False, description="Remove every pin of the camera"),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        camera = context.scene.camera
        if camera is None or camera.type != "CAMERA" or not len(camera.data.gssmc.pins):
            cls.poll_message_set("The scene camera has no pins; set one with Place by Pins")
            return False
        return super().poll(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        data = context.scene.camera.data
        pins, shown = data.gssmc.pins, state.numbers(context.scene, data)
        number = self.index if self.index >= 0 else (shown or [len(pins) - 1])[-1]
        if self.all:
            pins.clear()
            return self.done(context, rpt_("All pins were removed."))
        if number >= len(pins):
            raise RefineError(rpt_("There is no pin {number}; the last one is {last}.", number=number, last=len(pins) - 1))
        pins.remove(number)
        return self.done(context, rpt_("Pin {number} was removed.", number=number + 1))


classes = (GSSMC_OT_remove_pin,)
