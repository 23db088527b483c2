"""Solve Pins: the camera goes where its pins place it."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..gssmc_addon.clicks import surface
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.pins import state
from ..gssmc_addon.support.operator_parts import NeedsPhoto, PlainOperator

LENSES = (
    ("AUTO", "Auto", "The focal length where it is a guess, from four pins on"),
    ("FIXED", "Fixed", "Nothing of the lens"),
    ("FOCAL", "Focal", "The focal length, from four pins on"),
)


def solve_and_keep(context: bpy.types.Context, camera: bpy.types.Object, lens: str = "AUTO") -> str:
    """Places the camera by its pins, as one solution. What is to be said of it. Raises GssmcError, with nothing changed."""
    context.view_layer.update()  # Scripts set locations and expect them to be used.
    scene, splat = context.scene, surface.check(context.scene)
    start = state.camera_of(scene, camera, splat)
    report = state.solve(start, camera.data, "fixed" if lens == "FIXED" else "focal" if lens == "FOCAL" else "auto")
    photo_image.straighten(camera.data)
    state.show(scene, camera, splat, report)
    keyed = state.keep(scene, camera, splat, report)
    photo_camera.stop_moving_with_view()
    return " ".join([*report.reasons, *([keyed] if keyed else [])])


class GSSMC_OT_solve_pins(NeedsPhoto, Idle, PlainOperator, bpy.types.Operator):
    """Put the camera where its pins place it"""

    bl_idname = "gssmc.solve_pins"
    bl_label = "Solve Pins"
    bl_options = {"UNDO"}

    __annotations__ = {
        "lens": EnumProperty(name="Solve For", items=LENSES, default="AUTO", description="What of the lens is solved for"),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        return self.done(context, solve_and_keep(context, state.check(context.scene), self.lens))


classes = (GSSMC_OT_solve_pins,)
