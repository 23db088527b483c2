"""Set Floor: the splat stands on z = 0, level, and its cameras with it."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, FloatVectorProperty
from mathutils import Matrix, Vector

from ..core.errors import GssmcError, RefineError
from ..gssmc_addon.camera import together
from ..gssmc_addon.clicks import surface
from ..gssmc_addon.floor import motion
from ..gssmc_addon.floor.session import PointSession
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import rpt_

METHODS = (
    ("AUTO", "Automatic", "The largest plane below the cameras, level as the photos were held"),
    ("POINTS", "Three Points", "A plane through three points of the splat, which are clicked"),
)


class GSSMC_OT_set_floor(PointSession, Idle, PlainOperator, bpy.types.Operator):
    """Turn and shift the splat so that its floor is level and at height 0; the cameras of its photos go with it"""

    bl_idname = "gssmc.set_floor"
    bl_label = "Set Floor"
    bl_options = {"UNDO"}

    __annotations__ = {
        "method": EnumProperty(name="Method", items=METHODS, default="AUTO", description="What tells where the floor is"),
        "points": FloatVectorProperty(
            name="Points", size=9, description="Three points of the floor, in the scene: x y z x y z x y z"
        ),
    }

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        given = self.properties.is_property_set("points")
        if self.method == "AUTO" or given or context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        try:
            return self.begin_points(
                context, rpt_("Click three points of the floor    Backspace: the last one again    Esc: cancel")
            )
        except GssmcError as error:
            return self.refuse(str(error))

    def run(self, context: bpy.types.Context) -> set[str]:
        splat = surface.fresh(context)
        if self.method == "AUTO":
            return self._moved(context, splat, motion.onto_dominant_plane(context.scene, splat))
        if not self.properties.is_property_set("points"):
            raise RefineError(rpt_("The floor needs three points; give points, or click them in a 3D viewport."))
        values = list(self.points)
        return self.take(context, [Vector(values[i : i + 3]) for i in (0, 3, 6)])

    def take(self, context: bpy.types.Context, points: list[Vector]) -> set[str]:
        splat = surface.check(context.scene)
        cameras = [obj.matrix_world.translation for obj in motion.photo_cameras(context.scene, splat)]
        return self._moved(context, splat, motion.onto_floor(splat, points, cameras))

    def _moved(self, context: bpy.types.Context, splat: bpy.types.Object, found: Matrix) -> set[str]:
        count = together.move(context.scene, splat, found)
        if count == 1:
            return self.done(context, rpt_("The splat stands on its floor, and 1 camera with it."))
        return self.done(context, rpt_("The splat stands on its floor, and {count} cameras with it.", count=count))


classes = (GSSMC_OT_set_floor,)
