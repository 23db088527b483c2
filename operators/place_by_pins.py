"""Place by Pins: points of the splat are dragged to where the photo shows them, and the camera follows."""

from __future__ import annotations

import bpy

from ..core.errors import GssmcError
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.pins.apply import solve_and_keep
from ..gssmc_addon.pins.session import PinSession
from ..gssmc_addon.support.operator_parts import NeedsPhoto, PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_place_by_pins(PinSession, NeedsPhoto, Idle, PlainOperator, bpy.types.Operator):
    """Press on a point of the splat and drag it to where the photo shows it. From three such pins on the camera follows, from
    four on its focal length too where that is a guess"""

    bl_idname = "gssmc.place_by_pins"
    bl_label = "Place by Pins"
    bl_options = {"UNDO"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.area is None or context.area.type != "VIEW_3D":
            return self.refuse(rpt_("Pins are set in a 3D viewport; press the button there."))
        try:
            return self.begin(context)
        except GssmcError as error:
            return self.refuse(str(error))

    def run(self, context: bpy.types.Context) -> set[str]:
        """In a script: the camera goes where the pins that it has place it."""
        return self.done(context, solve_and_keep(context))


classes = (GSSMC_OT_place_by_pins,)
