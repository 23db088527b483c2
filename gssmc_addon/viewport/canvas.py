"""The picture of one splat in one region: drawn at once while the view moves, in slices when it rests, then kept.

Slices are drawn between redraws, for a redraw draws all that Blender has to show again, and may take many times as long.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gpu
import numpy as np

from .gpu import Before, Ground, Painter, SplatDraw, texture
from .lod import Budget

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
        """The ground of a picture with `shrink` pixels of the viewport to one of its own, along each side."""
        height, width = self.values.shape
        if self._texture is None:
            self._texture = texture(self.values)
        return Ground((max(1, width // shrink), max(1, height // shrink)), self._texture, shrink)


@dataclass
class _Work:
    """A picture in the making: what is drawn, on what, and how many Gaussians are done."""

    key: Any
    draw: SplatDraw
    ground: Ground
    moving: bool
    done: int = 0
    seconds: float = 0.0

    def part(self, slice_count: int) -> range:
        """What is drawn next. A moving picture's is half of it at least, for a redraw may come between any two."""
        count = max(slice_count, -(-self.draw.count // 2)) if self.moving else slice_count
        return range(self.done, min(self.draw.count, self.done + count))


class Canvas:
    """`paint` is called in every redraw; while there is `working`, `advance` between them until it asks for another redraw."""

    def __init__(self) -> None:
        self._shown: gpu.types.GPUOffScreen | None = None
        self._shown_key: Any = None
        self._next: gpu.types.GPUOffScreen | None = None
        self._work: _Work | None = None

    @property
    def working(self) -> bool:
        """Whether a picture is being made; it may be the first."""
        return self._work is not None

    @property
    def shows(self) -> bool:
        """True when there is a picture, be it an old one."""
        return self._shown is not None

    def paint(self, painter: Painter, draw: SplatDraw, depth: Depth, budget: Budget, moving: bool) -> None:
        """Brings the picture up to date, or has that begun.

        The very first is not drawn at once even if the view moves: it is not known yet how long drawing takes, and some
        drivers compile the shader in it.
        """
        key, shrink = (draw.key(), depth.stamp), budget.shrink if moving else 1
        if self._shown_key == (key, 1) or (moving and self._shown_key and self._shown_key[0] == key):
            self._work = None
        elif moving and (self._shown or (self._work and self._work.key != key)):
            self._work = None
            self._paint_at_once(painter, draw, depth.ground(shrink), budget)
            self._shown_key = key, shrink
        elif self._work is None or self._work.key != key:
            self._work = _Work(key, draw, depth.ground(shrink), moving)
            budget.begin()
            if draw.count <= budget.slice:  # The picture is small enough to be drawn in this redraw.
                self.advance(painter, budget)

    def lay_over(self, painter: Painter, opacity: float, before: Sequence[Before] = ()) -> None:
        """Draws the last whole picture over the viewport, at that opacity 0..1; nothing where there is none yet."""
        if self._shown:
            painter.lay_over(self._shown.texture_color, opacity, before)

    def free(self) -> None:
        """Gives up pictures and their memory on the graphics card. Main thread, with the window's context."""
        for buffer in (self._shown, self._next):
            if buffer:
                buffer.free()
        self._shown = self._next = self._work = None
        self._shown_key = None

    def _paint_at_once(self, painter: Painter, draw: SplatDraw, ground: Ground, budget: Budget) -> None:
        self._shown = _sized(self._shown, ground.size)
        start = time.perf_counter()
        with self._shown.bind():
            gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 0.0))
            painter.draw_splats(draw, ground)
            _wait()
        budget.moved(draw.count, time.perf_counter() - start)

    def advance(self, painter: Painter, budget: Budget) -> bool:
        """Draws a slice; True when the picture is complete, and is what `lay_over` lays from here on.

        Farther Gaussians first, as blending wants them.
        """
        work = self._work
        if work is None:
            return False
        part = work.part(budget.slice)
        start = time.perf_counter()
        if work.done == 0 or self._next is None:
            self._next = _sized(self._next, work.ground.size)
        with self._next.bind():
            if work.done == 0:
                gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 0.0))
            painter.draw_splats(work.draw, work.ground, part)
            _wait()
        seconds = time.perf_counter() - start
        if not work.moving:
            budget.sliced(len(part), seconds)
        work.done, work.seconds = part.stop, work.seconds + seconds
        if work.done < work.draw.count:
            return False
        self._shown, self._next, self._work = self._next, self._shown, None
        self._shown_key = work.key, work.ground.depth_step
        if work.moving:
            budget.moved(work.draw.count, work.seconds)
        return True


def _sized(buffer: gpu.types.GPUOffScreen | None, size: Size) -> gpu.types.GPUOffScreen:
    if buffer is None or (buffer.width, buffer.height) != size:
        if buffer:
            buffer.free()
        buffer = gpu.types.GPUOffScreen(*size, format="RGBA16F")
        buffer.texture_color.filter_mode(True)  # A picture of reduced size is enlarged when it is shown.
    return buffer


def _wait() -> None:
    """Until the graphics card has drawn, so that the time taken is known: one pixel is read back."""
    gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "FLOAT")
