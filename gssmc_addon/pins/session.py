"""Placing by pins with the mouse: press on the splat, drag to where the photo shows it; the camera follows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from ...core.errors import RefineError
from ...core.geometry.camera import Camera
from ...core.pose.pins.pin import Pin
from ...core.pose.pins.place import PinOptions
from ...core.pose.pins.report import PinReport
from ..camera import bridge as camera_bridge
from ..clicks.session import ClickSession
from ..clicks.surface import SeenView
from ..photo import camera as photo_camera
from ..photo import image as photo_image
from ..support.session_ids import by_uid
from ..support.texts import n_, rpt_
from . import state
from .screen import PhotoOnScreen

HELP = n_(
    "Press on the splat and drag to where the photo shows it    Drag a pin: move it    Ctrl-click or X: delete    "
    "Ctrl Z: take back    Enter: done    Esc: back to where the camera stood, pins stay"
)
GRAB_PX = 12.0  # how near to a pin the mouse takes hold of it
ENDING = ("RET", "NUMPAD_ENTER")


@dataclass(frozen=True)
class _Moment:
    """What a step can be taken back to."""

    pins: tuple[Pin, ...]
    camera: Camera


class PinSession(ClickSession):
    """A mixin: the modal part of Place by Pins."""

    _camera_uid = 0
    _before: Camera | None = None  # where the camera stood at the beginning
    _anchor: Camera | None = None  # where it stood when the drag began
    _dragged = -1  # the pin that is dragged
    _report: PinReport | None = None  # of the last solve
    _focal: float | None = None

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Looks through the camera and starts. Raises GssmcError."""
        camera = state.check(context.scene)
        self._past: list[_Moment] = []
        result = self.begin_session(context, rpt_(HELP))
        splat = context.scene.gssmc.splat
        self._camera_uid = camera.session_uid
        self._before = state.camera_of(context.scene, camera, splat)
        self._focal = state.focal_35mm(camera.data)
        photo_image.straighten(camera.data)
        photo_camera.stop_moving_with_view()
        if self.view().view_perspective != "CAMERA":
            self.view().view_perspective = "CAMERA"
        return result

    def holds(self, event: bpy.types.Event) -> bool:
        return self._dragged >= 0 and event.type in ("MOUSEMOVE", "LEFTMOUSE", "ESC")

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        kind, pressed = event.type, event.value == "PRESS"
        if kind == "MOUSEMOVE":
            if self._dragged >= 0:
                self._drag(context, event)
            return {"RUNNING_MODAL"} if self._dragged >= 0 else {"PASS_THROUGH"}
        if kind == "LEFTMOUSE":
            return self._mouse(context, event, pressed)
        return self._key(context, event) if pressed else {"PASS_THROUGH"}

    def _key(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        kind = event.type
        if kind in ENDING:
            return self._end(context, keep=True)
        if kind == "ESC":
            return self._escape(context)
        if kind in ("X", "DEL"):
            self._delete(context, event)
        elif kind == "Z" and event.ctrl:
            self._take_back(context)
        else:
            return {"PASS_THROUGH"} if kind.startswith(("NUMPAD", "HOME")) else {"RUNNING_MODAL"}
        return {"RUNNING_MODAL"}

    def leave(self, context: bpy.types.Context, keep: bool) -> set[str]:
        camera, splat = self._camera(context), self.splat(context)
        if camera is None or splat is None or self._before is None:
            return {"FINISHED"}
        if not keep:
            camera_bridge.write_camera(context.scene, camera, splat, self._before)
            return self.done(context, rpt_('"{name}" is back where it stood; its pins are kept.', name=camera.name))
        if self._report is None:
            return {"FINISHED"} if self._past else {"CANCELLED"}
        keyed = state.keep(context.scene, camera, splat, self._report)
        return self.done(context, " ".join([*self._report.reasons, *([keyed] if keyed else [])]))

    def _camera(self, context: bpy.types.Context) -> bpy.types.Object | None:
        return by_uid(context.scene.objects, self._camera_uid)

    def _objects(self, context: bpy.types.Context) -> tuple[bpy.types.Object, bpy.types.Object]:
        """Camera and splat. Raises RefineError when one of them is gone."""
        camera, splat = self._camera(context), self.splat(context)
        if camera is None or splat is None:
            raise RefineError(rpt_("The camera or the splat was removed; nothing was changed."))
        return camera, splat

    def _photo(self, context: bpy.types.Context) -> PhotoOnScreen | None:
        camera = self._camera(context)
        if camera is None or camera != context.scene.camera:
            return None
        return PhotoOnScreen.of(context.scene, camera, self.region(), self.view())

    def _place(self, event: bpy.types.Event) -> tuple[int, int]:
        """The mouse in the region's own pixels, wherever the event came from."""
        return event.mouse_x - self.region().x, event.mouse_y - self.region().y

    def _mouse(self, context: bpy.types.Context, event: bpy.types.Event, pressed: bool) -> set[str]:
        if not pressed:
            if self._dragged < 0:
                return {"PASS_THROUGH"}
            if self._anchor is not None:
                self._solve(context, self._anchor)  # once more with all care, for moves only follow
            self._dragged, self._anchor = -1, None
            return {"RUNNING_MODAL"}
        photo = self._photo(context)
        if photo is None:
            return {"PASS_THROUGH"}  # The view does not look through the camera.
        if event.ctrl:
            self._delete(context, event)
            return {"RUNNING_MODAL"}
        camera, splat = self._objects(context)
        found, place = self._under(context, event), self._place(event)
        if found < 0:
            point = self.surface().under_mouse(SeenView.of(self.region(), self.view(), splat), *place)
            if point is None:
                raise RefineError(rpt_("The splat shows nothing there; press on the splat."))
            self._remember(context)
            found = state.add(context.scene, camera.data, Pin(photo.to_photo(place), point))
        else:
            self._remember(context)
        self._dragged, self._anchor = found, state.camera_of(context.scene, camera, splat)
        self._solve(context, self._anchor)
        return {"RUNNING_MODAL"}

    def _drag(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        photo, (camera, _) = self._photo(context), self._objects(context)
        if photo is None or self._anchor is None or self._dragged >= len(camera.data.gssmc.pins):
            return
        camera.data.gssmc.pins[self._dragged].photo = photo.to_photo(self._place(event))
        self._solve(context, self._anchor, self._report.camera if self._report else None)

    def _solve(self, context: bpy.types.Context, start: Camera, last: Camera | None = None) -> None:
        """The camera follows its pins; where they lead nowhere it stays, and the header says why. `last`: as in PinOptions.

        Raises GssmcError.
        """
        options = PinOptions(focal_35mm=self._focal, last=last)
        (camera, splat), scene = self._objects(context), context.scene
        self._report, told = None, None
        if state.numbers(scene, camera.data):
            try:
                self._report = state.solve(scene, start, camera.data, options)
            except RefineError as error:
                told = str(error)
            else:
                state.show(scene, camera, splat, self._report)
                told = self._report.reasons[0]
        self._area.header_text_set(told)
        self.redraw()

    def _under(self, context: bpy.types.Context, event: bpy.types.Event) -> int:
        """The pin at the mouse; -1 where there is none."""
        photo, camera = self._photo(context), self._camera(context)
        if photo is None or camera is None:
            return -1
        here, reach = self._place(event), GRAB_PX * (context.preferences.system.ui_scale or 1.0)
        pins = state.of(context.scene, camera.data)
        away = [math.dist(photo.to_region(pin.photo), here) for pin in pins]
        near = away and min(away) <= reach
        return state.numbers(context.scene, camera.data)[away.index(min(away))] if near else -1

    def _delete(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        found, (camera, splat) = self._under(context, event), self._objects(context)
        if found < 0:
            return
        self._remember(context)
        camera.data.gssmc.pins.remove(found)
        self._dragged = -1
        self._solve(context, state.camera_of(context.scene, camera, splat))

    def _escape(self, context: bpy.types.Context) -> set[str]:
        """Ends a drag as if it had not been; else the session, with the camera back where it stood."""
        if self._dragged < 0:
            return self._end(context, keep=False)
        self._take_back(context)
        return {"RUNNING_MODAL"}

    def _remember(self, context: bpy.types.Context) -> None:
        camera, splat = self._objects(context)
        now = state.camera_of(context.scene, camera, splat)
        self._past.append(_Moment(tuple(state.of(context.scene, camera.data)), now))

    def _take_back(self, context: bpy.types.Context) -> None:
        """Blender's own undo cannot be used within an operator."""
        if not self._past:
            return
        camera, splat = self._objects(context)
        moment = self._past.pop()
        state.put(context.scene, camera.data, moment.pins)
        camera_bridge.write_camera(context.scene, camera, splat, moment.camera)
        self._dragged, self._anchor, self._report = -1, None, None
        if moment.pins:
            self._solve(context, moment.camera)
        self.redraw()

    def _clean(self, context: bpy.types.Context) -> None:
        super()._clean(context)
        if self._area is not None and self._is_here(context):
            self._area.header_text_set(None)
