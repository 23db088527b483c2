"""What the viewports show of splats: what to draw, how much of it, when to sort, when to draw again."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu
import numpy as np

from . import splat_object, viewport_props
from .viewport_clouds import Clouds
from .viewport_data import back_to_front, boost_for, order_table
from .viewport_gpu import Canvas, Painter, SplatDraw, SplatTextures, is_software, read_depth, texture
from .viewport_lod import Budget
from .viewport_thread import BackThread

TICK_S = 0.02
SETTLED_S = 0.25  # a view that has not moved for so long is completed
SORT_AGAIN = 1 - 1e-5  # cosine of a turn of a quarter degree


@dataclass
class _View:
    """One splat in one region."""

    canvas: Canvas = field(default_factory=Canvas)
    matrix: Any = None  # object to view, as drawn last
    moved_at: float = 0.0
    count: int = 0  # how many are wanted
    limit: int = 0  # how many there are to be had
    asked: tuple[Any, ...] = ()  # direction, count and version of the order that was asked for last
    table: np.ndarray | None = None  # an order that is not on the graphics card yet
    order: gpu.types.GPUTexture | None = None
    ordered: int = 0  # how many `order` holds
    stamp: int = 0
    version: int = -1


class Stage:
    """All that is drawn, in all regions."""

    def __init__(self) -> None:
        self.thread = BackThread()
        self.clouds = Clouds(self.thread)
        self.painter: Painter | None = None
        self.budget: Budget | None = None
        self._views: dict[tuple[int, int], _View] = {}
        self._frame: tuple[float, int, bool] | None = None  # start, Gaussians and motion of a redraw that is to be timed

    # ---- drawing

    def draw(self, context: bpy.types.Context) -> None:
        shown = _shown(context)
        if not shown:
            return
        if self.painter is None or self.budget is None:
            self.painter, self.budget = Painter(), Budget(is_software())
        start, drawn, moving = time.perf_counter(), 0, False
        depth = read_depth()
        for obj in shown:
            view = self._views.setdefault((context.region.as_pointer(), obj.data.session_uid), _View())
            drawn += self._draw_one(context, obj, view, depth)
            moving = moving or start - view.moved_at < SETTLED_S
        if drawn:
            self._frame = (start, drawn, moving)

    def _draw_one(self, context: bpy.types.Context, obj: bpy.types.Object, view: _View, depth: np.ndarray) -> int:
        """How many Gaussians had to be drawn."""
        textures, version = self.clouds.get(obj.data.session_uid)
        if textures is None or not textures.send_next():
            return 0
        region = context.region_data
        matrix = region.view_matrix @ obj.matrix_world
        if matrix != view.matrix:
            view.matrix, view.moved_at = matrix.copy(), time.perf_counter()
        if version != view.version:  # other Gaussians: their order is unknown
            view.version, view.order, view.table = version, None, None
        self._plan(context, obj, view, textures)
        if view.table is not None:
            view.order, view.table = texture(view.table), None
            view.stamp += 1
        if view.order is None:
            return 0
        count = min(view.ordered, textures.count)
        draw = SplatDraw(textures, view.order, count, boost_for(count, textures.count), matrix, (version, view.stamp))
        opacity = obj.gssmc.opacity * _xray(context.space_data.shading)
        return count if view.canvas.paint(self.painter, draw, region.window_matrix, opacity, depth) else 0

    def _plan(self, context: bpy.types.Context, obj: bpy.types.Object, view: _View, textures: SplatTextures) -> None:
        """Decides how many to draw, and asks for their order when that or the direction has changed."""
        view.limit = min(textures.count, obj.gssmc.max_shown)
        if time.perf_counter() - view.moved_at < SETTLED_S:
            view.count = self.budget.moving
        view.count = min(view.count, view.limit)
        direction = np.array(view.matrix.row[2][:3], np.float32)
        direction /= max(float(np.linalg.norm(direction)), 1e-30)
        if view.asked:
            old, count, version = view.asked
            if count == view.count and version == view.version and float(old @ direction) > SORT_AGAIN:
                return
        view.asked = (direction, view.count, view.version)
        means, version = textures.means[: view.count], view.version
        key = ("order", context.region.as_pointer(), obj.data.session_uid)
        self.thread.ask(key, lambda: (version, len(means), order_table(back_to_front(means, direction))))

    # ---- between redraws

    def tick(self) -> float | None:
        """Carries work on; seconds until the next call, None when there is nothing left to do."""
        if self._frame and self.budget:
            start, drawn, moving = self._frame
            self.budget.measured(drawn, time.perf_counter() - start, moving)
            self._frame = None
        changed = self._take_answers()
        busy = self.clouds.step()
        regions = _regions()
        for key in [key for key in self._views if key[0] not in regions]:
            self._views.pop(key).canvas.free()
        waiting = False
        for (_, uid), view in self._views.items():
            textures, _ = self.clouds.get(uid)
            changed = changed or (textures is not None and not textures.complete)
            waiting = waiting or time.perf_counter() - view.moved_at < SETTLED_S
            changed = self._complete(view) or changed
        if changed:
            for region in regions.values():
                region.tag_redraw()
        return TICK_S if changed or busy or waiting or not self.thread.idle() else None

    def _complete(self, view: _View) -> bool:
        """Wants more of a view that rests and has shown all it was to show; True when there is more to be had."""
        resting = time.perf_counter() - view.moved_at >= SETTLED_S and view.ordered == view.count and view.table is None
        if self.budget is None or not resting or view.order is None:
            return False
        count = self.budget.next_still(view.count, view.limit)
        more, view.count = count > view.count, max(count, view.count)
        return more

    def _take_answers(self) -> bool:
        found = self.thread.answers()
        for key, result in found:
            if key[0] == "cloud":
                self.clouds.accept(key[1], result)
                continue
            view = self._views.get(key[1:])
            if view and result and result[0] == view.version:
                _, view.ordered, view.table = result
        return bool(found)

    def clear(self) -> None:
        """Forgets every splat and frees what is on the graphics card."""
        self.thread.stop()
        for view in self._views.values():
            view.canvas.free()
        self._views.clear()
        self.clouds.clear()
        self._frame = None


def _shown(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Splat objects to draw in this viewport, from the farthest to the nearest."""
    space = context.space_data
    if not space.show_object_viewport_pointcloud:
        return []
    layer, eye = context.view_layer, context.region_data.view_matrix
    found = [
        obj
        for obj in layer.objects
        if obj.type == "POINTCLOUD"
        and viewport_props.shows_splats(obj)
        and not splat_object.has_native_type(obj.data)
        and obj.visible_get(view_layer=layer, viewport=space)
    ]
    return sorted(found, key=lambda obj: (eye @ obj.matrix_world.translation).z)


def _xray(shading: bpy.types.View3DShading) -> float:
    return shading.xray_alpha if shading.type == "SOLID" and shading.show_xray else 1.0


def _regions() -> dict[int, bpy.types.Region]:
    areas = (area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    return {region.as_pointer(): region for area in areas for region in area.regions if region.type == "WINDOW"}
