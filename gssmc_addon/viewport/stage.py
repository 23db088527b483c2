"""What the viewports show of splats: what to draw, how much of it, when to sort, when to draw again."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu
import numpy as np

from ..splat import object as splat_object
from . import props as viewport_props
from .canvas import Canvas, Depth
from .clouds import Clouds
from .data import back_to_front, boost_for, order_table
from .front import front_pictures
from .gpu import Painter, SplatDraw, SplatTextures, is_software, texture
from .lod import Budget
from .thread import BackThread

TICK_S = 0.01
SEND_S = 0.03  # Seconds of a tick for sending tables; a single table may take longer.
SETTLED_S = 0.25  # A view that has not moved for this many seconds is drawn in full.
SORT_AGAIN = 1 - 1e-5  # The cosine of a quarter of a degree.


@dataclass
class _View:
    """One splat in one region."""

    canvas: Canvas = field(default_factory=Canvas)
    seen: Any = None  # The matrices of the last drawing: object to view, and projection.
    moved_at: float = 0.0
    rested: bool = False  # as of the last tick
    live: bool = True  # in the region's last redraw
    count: int = 0  # how many are wanted
    limit: int = 0  # how many there are to be had
    asked: tuple[Any, ...] = ()  # Direction, count and version of the last order that was requested.
    indices: np.ndarray | None = None  # the order, farthest first
    sent: bool = True  # False while the order is not on the graphics card yet.
    order: gpu.types.GPUTexture | None = None
    stamp: int = 0
    version: int = -1

    def rests(self) -> bool:
        """True when the view does not move and shows a picture, so that a full drawing may take its time."""
        return self.canvas.shows and time.perf_counter() - self.moved_at >= SETTLED_S


class Stage:
    """All that is drawn, in all regions."""

    def __init__(self) -> None:
        self.thread = BackThread()
        self.clouds = Clouds(self.thread)
        self.painter: Painter | None = None
        self.budget: Budget | None = None
        self._views: dict[tuple[int, int], _View] = {}
        self._depths: dict[int, Depth] = {}

    # ---- drawing

    def draw(self, context: bpy.types.Context) -> bool:
        """Draws the splats of the region; True when there are any."""
        shown = _shown(context)
        living = {obj.data.session_uid for obj in shown}
        for (region, uid), view in self._views.items():
            if region == context.region.as_pointer():
                view.live = uid in living
        if not shown:
            return False
        if self.painter is None or self.budget is None:
            self.painter, self.budget = Painter(), Budget(is_software())
        depth = self._depths.setdefault(context.region.as_pointer(), Depth())
        moved = depth.update()
        before = self.painter.with_textures(front_pictures(context))
        for obj in shown:
            view = self._views.setdefault((context.region.as_pointer(), obj.data.session_uid), _View())
            if moved:
                view.moved_at = time.perf_counter()
            if self._draw_one(context, obj, view, depth):
                view.canvas.lay_over(self.painter, obj.gssmc.opacity * _share(context), before)
        return True

    def _draw_one(self, context: bpy.types.Context, obj: bpy.types.Object, view: _View, depth: Depth) -> bool:
        """Brings the splat's picture up to date; False when there is nothing to draw it of."""
        textures, version = self.clouds.get(obj.data.session_uid)
        if textures is None or self.painter is None or self.budget is None:
            return False
        region = context.region_data
        matrix = region.view_matrix @ obj.matrix_world
        seen = (matrix, region.window_matrix.copy())
        if seen != view.seen:
            view.seen, view.moved_at = seen, time.perf_counter()
        if version != view.version:  # These are other Gaussians, whose order is not known.
            view.version, view.order, view.indices = version, None, None
        self._plan(context, obj, view, textures)  # The order is computed while the tables are sent, between redraws.
        if not textures.complete:
            return False
        if view.indices is not None:
            if len(view.indices) > view.count:  # The view began to move: a sample is drawn, in the known order.
                view.indices, view.sent = view.indices[view.indices < view.count], False
            if not view.sent:
                view.order, view.sent = texture(order_table(view.indices)), True
                view.stamp += 1
        if view.order is not None and view.indices is not None:
            count = len(view.indices)
            boost = boost_for(count, textures.count)
            draw = SplatDraw(textures, view.order, count, boost, *seen, (version, view.stamp))
            view.canvas.paint(self.painter, draw, depth, self.budget, count < view.limit or not view.rests())
        return True

    def _plan(self, context: bpy.types.Context, obj: bpy.types.Object, view: _View, textures: SplatTextures) -> None:
        """Decides how many to draw, and asks for their order when that or the direction has changed."""
        view.limit = min(textures.count, obj.gssmc.max_shown)
        view.count = view.limit if view.rests() or self.budget is None else min(view.limit, self.budget.moving)
        direction = np.array(view.seen[0].row[2][:3], np.float32)
        direction /= max(float(np.linalg.norm(direction)), 1e-30)
        if view.asked:
            old, count, version = view.asked
            if count == view.count and version == view.version and float(old @ direction) > SORT_AGAIN:
                return
        view.asked = (direction, view.count, view.version)
        means, version = textures.means[: view.count], view.version
        key = ("order", context.region.as_pointer(), obj.data.session_uid)
        self.thread.ask(key, lambda: (version, back_to_front(means, direction)))

    # ---- between redraws

    def tick(self) -> float | None:
        """Continues the work. Returns the seconds until the next call, None when there is nothing left to do."""
        changed = self._take_answers()
        busy = self.clouds.step()
        regions = _regions()
        for key in [key for key in self._views if key[0] not in regions]:
            self._views.pop(key).canvas.free()
            self._depths.pop(key[0], None)
        drawn = False  # Only one slice or table per tick for all views, so that no tick takes long.
        for uid, view in [(key[1], view) for key, view in self._views.items() if view.live]:
            textures, _ = self.clouds.get(uid)
            working = view.canvas.working or (textures is not None and not textures.complete)
            if working and not drawn:
                changed, drawn = self._carry_on(view, textures) or changed, True
            if view.rests():  # What is shown was only good enough while the view moved.
                changed = changed or view.count < view.limit or not view.rested
            elif view.canvas.shows and self.budget is not None:
                changed = changed or self.budget.leaps(view.count, view.limit)
            view.rested = view.rests()
            busy = busy or working or not view.rested
        if changed:
            for region in regions.values():
                region.tag_redraw()
        return TICK_S if changed or busy or not self.thread.idle() else None

    def _carry_on(self, view: _View, textures: SplatTextures | None) -> bool:
        """What can be drawn, or sent to the graphics card, without a redraw; True when a redraw has something new to show."""
        if textures is not None and not textures.complete:
            until = time.perf_counter() + SEND_S  # All in one tick if possible, because Blender may redraw between two ticks.
            while not textures.send_next():
                if time.perf_counter() > until:
                    return False
            return True
        return self.painter is not None and self.budget is not None and view.canvas.advance(self.painter, self.budget)

    def _take_answers(self) -> bool:
        """True when a redraw has something new to show of them."""
        news = False
        for key, result in self.thread.answers():
            if key[0] == "cloud":
                news = self.clouds.accept(key[1], result) or news
                continue
            view, (textures, _) = self._views.get(key[1:]), self.clouds.get(key[2])
            if view and result and result[0] == view.version:
                view.indices, view.sent = result[1], False
                news = news or (textures is not None and textures.complete)  # Otherwise the last table requests the redraw.
        return news

    def clear(self) -> None:
        """Forgets every splat and frees what is on the graphics card."""
        self.thread.stop()
        for view in self._views.values():
            view.canvas.free()
        self._views.clear()
        self._depths.clear()
        self.clouds.clear()


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
        and not splat_object.is_native(obj.data)
        and obj.visible_get(view_layer=layer, viewport=space)
    ]
    return sorted(found, key=lambda obj: (eye @ obj.matrix_world.translation).z)


def _share(context: bpy.types.Context) -> float:
    """The opacity of the viewport's X-ray mode, 1 without it."""
    shading = context.space_data.shading
    return shading.xray_alpha if shading.type == "SOLID" and shading.show_xray else 1.0


def _regions() -> dict[int, bpy.types.Region]:
    areas = (area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    return {region.as_pointer(): region for area in areas for region in area.regions if region.type == "WINDOW"}
