"""The picture of one splat in one region: drawn at once while the view moves, in slices when it rests, then kept."""

from __future__ import annotations

import time
from typing import Any

import gpu
import numpy as np

from .viewport_gpu import Ground, Painter, SplatDraw, texture
from .viewport_lod import Budget

Size = tuple[int, int]


class Depth:
    """What the viewport's depth was at the last redraw of a region, and whether that changed anything."""

    def __init__(self) -> None:
        self.values = np.zeros((0, 0), np.float32)
        self.stamp = 0
        self._texture: gpu.types.GPUTexture | None = None

    def update(self) -> bool:
        """Reads the bound viewport's depth; True when it is another than before."""
        left, bottom, width, height = gpu.state.viewport_get()
        buffer = gpu.state.active_framebuffer_get().read_depth(left, bottom, width, height)
        values = np.array(buffer, np.float32, copy=True).reshape(height, width)
        if np.array_equal(values, self.values):
            return False
        self.values, self._texture = values, None
        self.stamp += 1
        return True

    def ground(self, shrink: int) -> Ground:
        height, width = self.values.shape
        if self._texture is None:
            self._texture = texture(self.values)
        return Ground((max(1, width // shrink), max(1, height // shrink)), self._texture, shrink)


class Canvas:
    """`paint` is called in every redraw; True in `working` asks for another one."""

    def __init__(self) -> None:
        self.working = False
        self._shown: gpu.types.GPUOffScreen | None = None
        self._shown_key: Any = None
        self._next: gpu.types.GPUOffScreen | None = None
        self._next_key: Any = None
        self._next_done = 0

    def paint(self, painter: Painter, draw: SplatDraw, depth: Depth, budget: Budget, moving: bool) -> None:
        """Brings the picture up to date, as far as one redraw may."""
        key = draw.key(), depth.stamp
        self.working = False
        if moving:
            if self._shown_key not in {(key, 1), (key, budget.shrink)}:
                self._paint_at_once(painter, draw, depth.ground(budget.shrink), budget)
                self._shown_key = key, budget.shrink
        elif self._shown_key != (key, 1):
            self._paint_slice(painter, draw, depth.ground(1), budget, key)

    def lay_over(self, painter: Painter, opacity: float) -> None:
        if self._shown:
            painter.lay_over(self._shown.texture_color, opacity)

    def free(self) -> None:
        for buffer in (self._shown, self._next):
            if buffer:
                buffer.free()
        self.__init__()

    def _paint_at_once(self, painter: Painter, draw: SplatDraw, ground: Ground, budget: Budget) -> None:
        self._shown = _sized(self._shown, ground.size)
        start = time.perf_counter()
        with self._shown.bind():
            gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 0.0))
            painter.draw_splats(draw, ground)
            _wait()
        budget.moved(draw.count, time.perf_counter() - start)

    def _paint_slice(self, painter: Painter, draw: SplatDraw, ground: Ground, budget: Budget, key: Any) -> None:
        """Farther Gaussians first, as blending wants them; the picture is shown when the nearest have been added."""
        fresh = self._next_key != key
        if fresh:
            self._next, self._next_key, self._next_done = _sized(self._next, ground.size), key, 0
        part = range(self._next_done, min(draw.count, self._next_done + budget.slice))
        start = time.perf_counter()
        with self._next.bind():
            if fresh:
                gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 0.0))
            painter.draw_splats(draw, ground, part)
            _wait()
        budget.sliced(len(part), time.perf_counter() - start)
        self._next_done = part.stop
        self.working = part.stop < draw.count
        if not self.working:
            self._shown, self._next = self._next, self._shown
            self._shown_key, self._next_key = (key, 1), None


def _sized(buffer: gpu.types.GPUOffScreen | None, size: Size) -> gpu.types.GPUOffScreen:
    if buffer is None or (buffer.width, buffer.height) != size:
        if buffer:
            buffer.free()
        buffer = gpu.types.GPUOffScreen(*size, format="RGBA16F")
        buffer.texture_color.filter_mode(True)  # a shrunken picture is stretched
    return buffer


def _wait() -> None:
    """Until the graphics card has drawn, so that the time taken is known: one pixel is read back."""
    gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "FLOAT")
