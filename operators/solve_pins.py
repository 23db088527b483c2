"""Solve Pins: the camera goes where its pins place it."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.pins.apply import solve_and_keep
from ..gssmc_addon.support.operator_parts import NeedsPhoto, PlainOperator

LENSES = (
    ("AUTO", "Auto", "The focal length where it is a guess, from four pins on"),
    ("FIXED", "Fixed", "Nothing of the lens"),
    ("FOCAL", "Focal", "The focal length, from four pins on"),
)


class GSSMC_OT_solve_pins(NeedsPhoto, Idle, PlainOperator, bpy.types.Operator):
    """Put the camera where its pins place it"""

    bl_idname = "gssmc.solve_pins"
    bl_label = "Solve Pins"
    bl_options = {"UNDO"}

    __annotations__ = {
        "lens": EnumProperty(name="Solve For", items=LENSES, default="AUTO", description="What of the lens is solved for"),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(context, solve_and_keep(context, self.lens))


classes = (GSSMC_OT_solve_pins,)
