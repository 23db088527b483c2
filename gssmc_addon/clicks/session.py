"""What modal operators with clicks on the splat share: the surface is prepared beside the window, then clicks are taken."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import bpy

from ...core.errors import GssmcError
from ..jobs import slot
from ..support.operator_parts import PlainOperator
from ..support.session_ids import by_uid
from ..support.texts import rpt_, sentence
from .surface import SplatSurface, SurfaceJob, check, job_of

log = logging.getLogger(__name__)
TICK_S = 0.05
# What moves the view, or belongs to Blender's own windows, goes on as ever.
PASSED = ("MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "WHEELINMOUSE", "WHEELOUTMOUSE", "TRACKPADPAN", "TRACKPADZOOM")

if TYPE_CHECKING:
    ClickMixin = PlainOperator
else:
    ClickMixin = object


class ClickSession(ClickMixin):
    """A mixin of PlainOperator. The operator says what it does with an event in `on_event` and how it ends in `leave`."""

    _job: SurfaceJob | None = None
    _surface: SplatSurface | None = None
    _timer: Any = None
    _area: Any = None
    _splat_uid = 0

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """The operator's answer to an event in its viewport. Raises GssmcError, which is reported, and the session goes on."""
        raise NotImplementedError

    def leave(self, context: bpy.types.Context, keep: bool) -> set[str]:
        """The operator's result at its end; `keep`: what was done stays. Raises GssmcError."""
        raise NotImplementedError

    def begin_session(self, context: bpy.types.Context, help_text: str) -> set[str]:
        """Starts to take clicks in the viewport at hand. Raises GssmcError."""
        splat = check(context.scene)
        self._splat_uid, self._area = splat.session_uid, context.area
        self._job = job_of(splat)
        self._job.start()
        self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
        context.workspace.status_text_set(help_text)
        context.window_manager.modal_handler_add(self)
        self.redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            if slot.active() or self.splat(context) is None or not self._is_here(context):
                return self._end(context, keep=True)  # A job began, or another file, splat or screen is there.
            if event.type == "TIMER":
                return self._prepare(context)
            if event.type in PASSED or not self.is_inside(event):
                return self.on_event(context, event) if self.holds(event) else {"PASS_THROUGH"}
            return self.on_event(context, event)
        except GssmcError as error:
            self.report({"WARNING"}, str(error))
            return {"RUNNING_MODAL"}
        except Exception as error:
            log.exception("The clicks broke off")
            self.report({"ERROR"}, sentence(error))
            return self._end(context, keep=True)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: its window is closed, or another file is opened."""
        self._clean(context)

    def holds(self, event: bpy.types.Event) -> bool:
        """Whether an event outside of the viewport is the session's all the same, such as the end of a drag."""
        return False

    def is_inside(self, event: bpy.types.Event) -> bool:
        """Whether the mouse is over the viewport itself, not over its header, sidebar or toolbar."""
        if self._area is None:
            return False
        inside = [
            region
            for region in self._area.regions
            if region.x <= event.mouse_x < region.x + region.width and region.y <= event.mouse_y < region.y + region.height
        ]
        return bool(inside) and all(region.type == "WINDOW" for region in inside if region.width > 1)

    def splat(self, context: bpy.types.Context) -> bpy.types.Object | None:
        """The splat that is clicked at, None when it is gone."""
        splat = by_uid(context.scene.objects, self._splat_uid)
        return splat if splat is not None and splat == context.scene.gssmc.splat else None

    def surface(self) -> SplatSurface:
        """What clicks land on. Raises GssmcError while it is not ready."""
        if self._surface is None:
            raise GssmcError(rpt_("The splat is still being prepared; click again in a moment."))
        return self._surface

    def region(self) -> Any:
        """The viewport's own region."""
        return next(region for region in self._area.regions if region.type == "WINDOW")

    def view(self) -> Any:
        """The viewport's RegionView3D."""
        return self._area.spaces.active.region_3d

    def redraw(self) -> None:
        """Draws the viewport again, with what handlers lay over it."""
        if self._area is not None:
            self._area.tag_redraw()

    def _prepare(self, context: bpy.types.Context) -> set[str]:
        """Goes on with the surface; where there is none to be had, the session ends."""
        if self._job is None:
            return {"PASS_THROUGH"}
        try:
            found = self._job.tick()
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return self._end(context, keep=False)
        if found is not None:
            self._surface, self._job = found, None
        return {"PASS_THROUGH"}

    def _is_here(self, context: bpy.types.Context) -> bool:
        areas = context.window.screen.areas if context.window else ()
        return any(area == self._area for area in areas) and self._area.type == "VIEW_3D"

    def _end(self, context: bpy.types.Context, keep: bool) -> set[str]:
        self._clean(context)
        try:
            return self.leave(context, keep)
        except GssmcError as error:
            return self.refuse(str(error))

    def _clean(self, context: bpy.types.Context) -> None:
        """Ends what runs: the preparation, the timer, the line in the status bar."""
        job, timer, self._job, self._timer = self._job, self._timer, None, None
        if job is not None:
            job.cancel()
        if timer is not None:
            context.window_manager.event_timer_remove(timer)
            context.workspace.status_text_set(None)
            self.redraw()
