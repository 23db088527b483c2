"""Add Pin: a pixel of the photo and a point of the splat, for scripts; Place by Pins sets them with the mouse."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty
from mathutils import Vector

from ..core.errors import RefineError
from ..core.pose.pins.pin import Pin, check_inside
from ..gssmc_addon.clicks import surface
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.pins import state
from ..gssmc_addon.pins.apply import solve_and_keep, splat_and_camera
from ..gssmc_addon.support.operator_parts import NeedsPhoto, PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_add_pin(NeedsPhoto, Idle, PlainOperator, bpy.types.Operator):
    """Pin a pixel of the photo to a point of the splat"""

    bl_idname = "gssmc.add_pin"
    bl_label = "Add Pin"
    bl_options = {"UNDO"}

    __annotations__ = {
        "photo_x": FloatProperty(name="Photo X", description="Pixels of the photo's own file, from its left"),
        "photo_y": FloatProperty(name="Photo Y", description="Pixels of the photo's own file, from its top"),
        "world": FloatVectorProperty(
            name="Point", description="The point of the splat, in the scene", size=3, subtype="XYZ", precision=4
        ),
        "splat_x": FloatProperty(
            name="Splat X", description="Where the camera sees the point now, in place of it; pixels of the photo's size"
        ),
        "splat_y": FloatProperty(name="Splat Y", description="The same from the top"),
        "weight": FloatProperty(name="Weight", description="How many clicks by hand it counts as", default=1.0, min=0.01),
        "solve": BoolProperty(name="Solve", default=False, description="Put the camera where its pins place it"),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        splat, camera = splat_and_camera(context)
        given = self.properties.is_property_set
        if not (given("photo_x") and given("photo_y")):
            raise RefineError(rpt_("A pin needs its pixel of the photo; give photo_x and photo_y."))
        if given("world"):
            point = surface.in_splat(splat, Vector(self.world))
        elif given("splat_x") and given("splat_y"):
            point = self._seen(context, camera, splat)
        else:
            raise RefineError(rpt_("A pin needs its point of the splat; give world, or splat_x and splat_y."))
        pin = Pin((self.photo_x, self.photo_y), point, self.weight)
        check_inside([pin], *state.size_of(camera.data))
        number = state.add(context.scene, camera.data, pin) + 1
        if self.solve:
            return self.done(context, solve_and_keep(context))
        return self.done(context, rpt_('Pin {number} of "{name}" is set.', number=number, name=camera.name))

    def _seen(
        self, context: bpy.types.Context, camera: bpy.types.Object, splat: bpy.types.Object
    ) -> tuple[float, float, float]:
        """The point that the camera sees at splat_x, splat_y. Raises RefineError where it sees nothing of the splat."""
        now = state.camera_of(context.scene, camera, splat)
        found = surface.job_of(splat).run().point(now.intrinsics.pinhole(), now.pose, (self.splat_x, self.splat_y))
        if found is None:
            raise RefineError(rpt_("The splat shows nothing there; give a pixel at which the camera sees it."))
        return found


classes = (GSSMC_OT_add_pin,)
