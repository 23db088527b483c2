"""Splats in the 3D viewports that Blender does not draw itself: the draw handler, the timer, the app handlers.

Nothing runs while nothing changes: a redraw starts the timer, which ends itself when all is read, sorted and shown.
"""

from __future__ import annotations

import logging
from typing import Any

import bpy

from . import native
from . import props as viewport_props
from .clouds import Prepared
from .stage import Stage

log = logging.getLogger(__name__)
UNDRAWABLE = "Splats cannot be drawn with this graphics card; they are shown as points"


class _DrawHandler:
    """The one stage of this Blender and its draw handler."""

    def __init__(self) -> None:
        self.stage: Stage | None = None
        self.handle: Any = None


_handler = _DrawHandler()


def prime(cloud: bpy.types.PointCloud, prepared: Prepared) -> None:
    """Hands over what an importer has in memory already, so that it need not be read back from Blender."""
    if _handler.stage:
        _handler.stage.clouds.accept(cloud.session_uid, prepared)


def _draw() -> None:
    if _handler.stage is None:
        return
    try:
        drawn = _handler.stage.draw(bpy.context)
    except Exception:  # Whatever a driver refuses, the splats become points and the log says so once.
        log.exception(UNDRAWABLE)
        _turn_into_points()
        return
    if drawn:
        _wake()


def _turn_into_points() -> None:
    viewport_props.set_drawable(False)
    bpy.app.timers.register(_give_up, first_interval=0.0)


def _give_up() -> None:
    _stop_drawing()
    viewport_props.apply_all()


def _wake() -> None:
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0, persistent=True)


def _tick() -> float | None:
    if _handler.stage is None:
        return None
    try:
        return _handler.stage.tick()
    except Exception:  # Part of the drawing is done here, so the same errors can occur as in _draw.
        log.exception(UNDRAWABLE)
        _turn_into_points()
        return None


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    if _handler.stage:
        _handler.stage.clear()


@bpy.app.handlers.persistent
def _after_load(*_: object) -> None:
    native.take_over(native.open_file())
    viewport_props.apply_all()


@bpy.app.handlers.persistent
def _after_import(context: bpy.types.BlendImportContext, *_: object) -> None:
    """Something was linked or appended from another file."""
    native.take_over(native.imported(context))
    viewport_props.apply_all()


@bpy.app.handlers.persistent
def _after_undo(*_: object) -> None:
    if _handler.stage:
        _handler.stage.clouds.mark_all_stale()
        _wake()


@bpy.app.handlers.persistent
def _after_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _handler.stage is None or not depsgraph.id_type_updated("POINTCLOUD"):
        return
    for update in depsgraph.updates:
        if isinstance(update.id, bpy.types.PointCloud) and update.is_updated_geometry:
            _handler.stage.clouds.mark_stale(update.id.original.session_uid)
            _wake()


_HANDLERS = {
    "load_pre": _before_load,
    "load_post": _after_load,
    "blend_import_post": _after_import,
    "undo_post": _after_undo,
    "redo_post": _after_undo,
    "depsgraph_update_post": _after_update,
}


def register() -> None:
    viewport_props.register()
    for kind, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, kind).append(handler)
    if not bpy.app.background:
        _handler.stage = Stage()
        _handler.handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")
        viewport_props.set_drawable(True)
    bpy.app.timers.register(_show_open_file, first_interval=0.0)


def _show_open_file() -> None:
    """The extension was switched on in a file that is open already; register() itself may not touch data."""
    _after_load()


def _stop_drawing() -> None:
    viewport_props.set_drawable(False)
    if _handler.handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handler.handle, "WINDOW")
    if _handler.stage is not None:
        _handler.stage.clear()
    _handler.stage = _handler.handle = None


def unregister() -> None:
    """Splats turn into points, since nobody draws them from here on."""
    _stop_drawing()
    for timer in (_tick, _give_up, _show_open_file):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    if hasattr(bpy.data, "objects"):
        viewport_props.apply_all()
    for kind, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, kind).remove(handler)
    viewport_props.unregister()
