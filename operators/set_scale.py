"""Set Scale: two points of the splat get the distance that they have in the world, and its cameras go with it."""

from __future__ import annotations

import bpy
from bpy.props import FloatProperty, FloatVectorProperty
from mathutils import Vector

from ..core.errors import GssmcError, RefineError
from ..gssmc_addon.camera import together
from ..gssmc_addon.clicks import surface
from ..gssmc_addon.floor import motion
from ..gssmc_addon.floor.session import PointSession
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_set_scale(PointSession, Idle, PlainOperator, bpy.types.Operator):
    """Click two points of the splat and tell how far apart they are; splat and cameras are scaled so that this is true"""

    bl_idname = "gssmc.set_scale"
    bl_label = "Set Scale"
    bl_options = {"UNDO"}
    wanted = 2

    __annotations__ = {
        "points": FloatVectorProperty(name="Points", size=6, description="Two points, in the scene: x y z x y z"),
        "distance": FloatProperty(
            name="Distance",
            default=1.0,
            min=0.0,
            precision=4,
            subtype="DISTANCE",
            unit="LENGTH",
            description="How far apart they are",
        ),
    }

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.properties.is_property_set("points"):
            return context.window_manager.invoke_props_dialog(self, title=self.bl_label)
        if context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        try:
            return self.begin_points(
                context, rpt_("Click two points whose distance you know    Backspace: again    Esc: cancel")
            )
        except GssmcError as error:
            return self.refuse(str(error))

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "distance")

    def take(self, context: bpy.types.Context, points: list[Vector]) -> set[str]:
        """Asks how far apart they are; that dialog is an operator of its own, and the undo step with it."""
        a, b = points
        bpy.ops.gssmc.set_scale("INVOKE_DEFAULT", points=(*a, *b), distance=(b - a).length)
        return {"CANCELLED"}

    def run(self, context: bpy.types.Context) -> set[str]:
        splat = surface.fresh(context)
        if not (self.properties.is_property_set("points") and self.properties.is_property_set("distance")):
            raise RefineError(rpt_("The scale needs two points and their distance; give both, or click in a 3D viewport."))
        values = list(self.points)
        points = [Vector(values[i : i + 3]) for i in (0, 3)]
        before = (points[1] - points[0]).length
        count = together.move(context.scene, splat, motion.to_scale(points, self.distance))
        factor = self.distance / before
        if count == 1:
            return self.done(context, rpt_("The splat is {factor:.4g} times as large; 1 camera moved with it.", factor=factor))
        told = rpt_("The splat is {factor:.4g} times as large; {count} cameras moved with it.", factor=factor, count=count)
        return self.done(context, told)


classes = (GSSMC_OT_set_scale,)
