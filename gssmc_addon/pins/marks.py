"""The pins over the photo where a viewport looks through their camera: where each was set, and where its point is seen."""

from __future__ import annotations

import logging
import math
from typing import Any

import bpy

from ...core.errors import GssmcError
from ..clicks.draw import Colour, Marks, draw
from ..splat import object as splat_object
from ..support.texts import iface_
from . import state
from .screen import PhotoOnScreen

log = logging.getLogger(__name__)
# Errors up to so many pixels of a photo 1280 px wide are what a hand does; from the second on a pin is bad.
FINE_PX, BAD_PX, WIDTH_PX = 3.0, 10.0, 1280
FINE: Colour = (0.35, 0.9, 0.4, 1.0)
FAIR: Colour = (1.0, 0.8, 0.2, 1.0)
BAD: Colour = (1.0, 0.3, 0.25, 1.0)


class _Handler:
    """The draw handler of this Blender."""

    handle: Any = None


_handler = _Handler()


def colour_of(error_px: float, long_side_px: int) -> Colour:
    """Green for what a hand does, yellow, and red where something is wrong."""
    error = error_px * min(1.0, WIDTH_PX / long_side_px)
    return FINE if error <= FINE_PX else FAIR if error <= BAD_PX else BAD


def marks_of(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, photo: PhotoOnScreen) -> Marks:
    """What is drawn of the camera's pins. Raises GssmcError when the camera is none that sees the splat."""
    marks = Marks()
    for number, (pixel, seen) in enumerate(state.errors_now(scene, camera, splat), 1):
        error = math.dist(pixel, seen) if seen else math.inf
        colour, place = colour_of(error, max(photo.size)), photo.to_region(pixel)
        marks.rings.append((place, colour))
        if seen:
            at = photo.to_region(seen)
            marks.crosses.append((at, colour))
            marks.lines.append((place, at, colour))
            marks.words.append((place, iface_("{number}: {error:.1f} px", number=number, error=error), colour))
        else:
            marks.words.append((place, iface_("{number}: behind", number=number), colour))
    return marks


def _draw() -> None:
    context = bpy.context
    scene, space = context.scene, context.space_data
    camera, splat = scene.camera, scene.gssmc.splat
    if camera is None or camera.type != "CAMERA" or not camera.data.gssmc.pins or not scene.gssmc.show_pins:
        return
    if space.camera != camera or not space.overlay.show_overlays or not splat_object.is_splat(splat):
        return
    try:
        photo = PhotoOnScreen.of(scene, camera, context.region, context.region_data)
        if photo is not None:
            draw(marks_of(scene, camera, splat, photo))
    except GssmcError:
        return  # The panel says what is wrong with the camera or the splat.
    except Exception:  # Nothing that goes wrong here may come back with every redraw.
        log.exception("The pins cannot be drawn")
        bpy.app.timers.register(unregister, first_interval=0.0)


def register() -> None:
    if not bpy.app.background:
        _handler.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    if _handler.handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handler.handle, "WINDOW")
    _handler.handle = None
