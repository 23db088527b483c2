"""Points of the splat, clicked one after the other in the viewport."""

from __future__ import annotations

from itertools import pairwise

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

from ...core.errors import GssmcError
from ..clicks.draw import Colour, Marks, draw
from ..clicks.session import ClickSession
from ..clicks.surface import SeenView, in_scene
from ..support.texts import n_, rpt_

NOTHING = n_("The splat shows nothing there; click on the splat.")
POINT: Colour = (1.0, 0.8, 0.2, 1.0)


class PointSession(ClickSession):
    """A mixin: takes `wanted` points, then calls `take` with them."""

    wanted = 3
    _handle = None

    def take(self, context: bpy.types.Context, points: list[Vector]) -> set[str]:
        """The operator's work with the points, in the scene, and its result. Raises GssmcError."""
        raise NotImplementedError

    def begin_points(self, context: bpy.types.Context, help_text: str) -> set[str]:
        """Starts to take clicks. Raises GssmcError."""
        self._points: list[Vector] = []
        result = self.begin_session(context, help_text)
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        return result

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.value != "PRESS":
            return {"PASS_THROUGH"}
        if event.type in ("ESC", "RIGHTMOUSE"):
            return self._end(context, keep=False)
        if event.type == "BACK_SPACE" and self._points:
            self._points.pop()
            self.redraw()
        elif event.type == "LEFTMOUSE":
            self._click(context, event)
            if len(self._points) == self.wanted:
                return self._end(context, keep=True)
        else:
            return {"PASS_THROUGH"}
        return {"RUNNING_MODAL"}

    def leave(self, context: bpy.types.Context, keep: bool) -> set[str]:
        if not keep or len(self._points) < self.wanted:
            return {"CANCELLED"}
        return self.take(context, self._points)

    def _click(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        splat, region = self.splat(context), self.region()
        if splat is None:
            return
        view = SeenView.of(region, self.view(), splat)
        point = self.surface().under_mouse(view, event.mouse_x - region.x, event.mouse_y - region.y)
        if point is None:
            raise GssmcError(rpt_(NOTHING))
        self._points.append(in_scene(splat, point))
        self.redraw()

    def _draw(self) -> None:
        """The points so far, with lines between them."""
        region, view = bpy.context.region, bpy.context.region_data
        seen = [location_3d_to_region_2d(region, view, point) for point in self._points]
        places = [(at.x, at.y) for at in seen if at is not None]
        marks = Marks(rings=[(at, POINT) for at in places], crosses=[(at, POINT) for at in places])
        marks.lines.extend((one, other, POINT) for one, other in pairwise(places))
        draw(marks)

    def _clean(self, context: bpy.types.Context) -> None:
        handle, self._handle = self._handle, None
        if handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
        super()._clean(context)
