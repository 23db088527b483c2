"""A scan on the graphics card, and its views: exactly those of `core.render`, up to float32 rounding.

A view is drawn front to back in batches of splats. Within a batch, quads are blended from the last to the first into float32
targets; a batch is then joined behind what was drawn before, which each pixel's transmittance weighs. INRIA's rasteriser ends a
pixel before the splat that would take its transmittance below a limit. Blending cannot stop there, so a pixel that ends within
a batch is left as it was before that batch, and the batch's splats are composited for it one after the other at the end. Depths
of a batch are relative to its first splat, which keeps their variance exact where float32 squares of depths would not.

All of this belongs to the main thread, with a GPU context; the functions are generators that yield between steps, so that the
caller can give the window its turn. Nothing is bound at a yield, for Blender draws its own meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass

import gpu
import numpy as np

from ...core.geometry.camera import Intrinsics, Pose
from ...core.render import constants as c
from ...core.render.view import RenderedView
from ..viewport.gpu import texture
from .shaders import Shaders
from .tables import TABLE_WIDTH, ScanTexels, as_rows

BATCHES = 96  # that a view is drawn in, where that makes batches of a size within the bounds
BATCH_MIN, BATCH_MAX = 64, 4096  # splats
SENT_ROWS = 32  # rows of a table that are sent at once: 4 MB
BAND_ROWS = 32  # rows of the image that are finished at once
STEP_S = 0.008  # seconds that the graphics card may be given work for before it is waited for
Steps = Generator[None, None, None]


@dataclass(frozen=True, eq=False)
class ViewRequest:
    """A view to be drawn: the camera, and what it may see of the scan as `tables.seen_points` gives it."""

    intrinsics: Intrinsics
    pose: Pose
    points: np.ndarray


class Pace:
    """Says when to wait for the graphics card: Python hands it work much faster than it is done."""

    def __init__(self) -> None:
        self._count, self._group = 0, 1
        self._since = 0.0

    def begin(self) -> None:
        """To be called before each piece of work."""
        if self._count == 0:
            self._since = time.perf_counter()

    def wait(self) -> bool:
        """To be called after each piece of work, with its framebuffer bound. True when the card was waited for, so that the
        caller may pause once the framebuffer is unbound.
        """
        self._count += 1
        if self._count < self._group:
            return False
        gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        taken = time.perf_counter() - self._since
        if taken > STEP_S:
            self._group = max(1, int(self._group * STEP_S / taken))
        elif 2 * taken < STEP_S:
            self._group = min(64, 2 * self._group)
        self._count = 0
        return True


class Target:
    """Float32 textures of one size with the framebuffer that draws into all of them."""

    def __init__(self, width: int, height: int, count: int) -> None:
        self.width, self.height = width, height
        self.textures = [gpu.types.GPUTexture((width, height), format="RGBA32F") for _ in range(count)]
        self.buffer = gpu.types.GPUFrameBuffer(color_slots=self.textures)

    def read(self, slot: int) -> np.ndarray:
        """The texture's values (height, width, 4), from a bound framebuffer."""
        data = self.buffer.read_color(0, 0, self.width, self.height, 4, slot, "FLOAT")
        return np.array(data, np.float32, copy=True).reshape(self.height, self.width, 4)


class ImageTargets:
    """What a view of one size is drawn in: the image so far, twice, for a pass cannot read what it writes; a batch; the end."""

    def __init__(self, width: int, height: int) -> None:
        self.size = (width, height)
        self.joined = [Target(width, height, 2) for _ in range(2)]
        self.batch = Target(width, height, 2)


class GpuScan:
    """One scan on the graphics card. `send` first, then `draw` as often as wanted."""

    def __init__(self, shaders: Shaders, scan: ScanTexels) -> None:
        self._shaders, self._coefficients, self._antialiased = shaders, scan.coefficients, scan.antialiased
        self._table: gpu.types.GPUTexture | None = None  # set once it was sent
        self._images: ImageTargets | None = None

    def send(self, scan: ScanTexels) -> Steps:
        """Compiles the shaders and sends the scan's table, a part in each step, so that none takes long."""
        for _ in self._shaders.compiled(self._coefficients, self._antialiased):
            yield
        texels = scan.texels.reshape(-1, 4)
        rows = -(-max(len(texels), 1) // TABLE_WIDTH)
        whole = Target(TABLE_WIDTH, rows, 1)
        for first in range(0, rows, SENT_ROWS):
            part = as_rows(texels[first * TABLE_WIDTH : (first + SENT_ROWS) * TABLE_WIDTH])
            sent = texture(part)
            with _drawing(whole):
                gpu.state.viewport_set(0, first, TABLE_WIDTH, len(part))
                self._shaders.copy.draw([sent], {"first_row": first})
                whole.buffer.read_color(0, first, 1, 1, 4, 0, "FLOAT")  # the part's texture must outlive the drawing
            yield
        self._table = whole.textures[0]

    def draw(self, request: ViewRequest) -> Generator[None, None, RenderedView]:
        """Draws a view."""
        k, points = request.intrinsics, request.points
        if self._images is None or self._images.size != (k.width, k.height):
            self._images = ImageTargets(k.width, k.height)
        assert self._table is not None, "the scan is sent first"
        images, count = self._images, len(points)
        if not count:
            black = np.zeros((k.height, k.width), np.float32)
            return RenderedView(np.zeros((k.height, k.width, 3), np.float32), black, black.copy(), black.copy())
        splats = self._projected(request, self._table)
        yield
        size = min(max(-(-count // BATCHES), BATCH_MIN), BATCH_MAX)
        for begun, transmittance in zip(images.joined[0].textures, (1.0, 0.0), strict=True):
            begun.clear(format="FLOAT", value=(0.0, 0.0, 0.0, transmittance))
        pace, now = Pace(), 0
        for number, first in enumerate(range(0, count, size)):
            pace.begin()
            numbers = {"batch": number, "depth0": float(points[first, 2])}
            self._batch(splats, images, now, (first, min(first + size, count)), numbers["depth0"])
            with _drawing(images.joined[1 - now]):
                self._shaders.join.draw([*images.joined[now].textures, *images.batch.textures], numbers)
                now = 1 - now
                done = pace.wait()
            if done:
                yield
        return (yield from self._finish(splats, images, now, (size, count)))

    def _projected(self, request: ViewRequest, table: gpu.types.GPUTexture) -> Target:
        """The splats of a view: centres, shapes and colours, in the order of its points."""
        points = as_rows(request.points)
        splats = Target(TABLE_WIDTH, len(points), 3)
        block = _view_block(request)  # It has to live until the draw, because the shader does not hold it.
        shader = self._shaders.project(self._coefficients, self._antialiased)
        with _drawing(splats):
            shader.draw([table, texture(points)], block=block)
            splats.buffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        return splats

    def _batch(self, splats: Target, images: ImageTargets, now: int, part: tuple[int, int], depth0: float) -> None:
        """The splats `part`, blended from the last to the first, where the image `now` has not ended."""
        width, height = images.size
        with _drawing(images.batch, "ALPHA_PREMULT"):
            images.batch.buffer.clear(color=(0.0, 0.0, 0.0, 0.0))
            numbers = {"last": part[1] - 1, "width": width, "height": height, "depth0": depth0}
            self._shaders.splat.draw([*splats.textures, images.joined[now].textures[1]], numbers, part[1] - part[0])

    def _finish(
        self, splats: Target, images: ImageTargets, now: int, sizes: tuple[int, int]
    ) -> Generator[None, None, RenderedView]:
        """The image, in bands; `sizes`: of a batch, and of the view's splats."""
        width, height = images.size
        numbers = {"batch_size": sizes[0], "count": sizes[1]}
        textures = [*images.joined[now].textures, *splats.textures]
        pace = Pace()
        for first in range(0, height, BAND_ROWS):
            pace.begin()
            with _drawing(images.batch):
                gpu.state.viewport_set(0, 0, width, height)
                gpu.state.scissor_test_set(True)
                gpu.state.scissor_set(0, first, width, min(BAND_ROWS, height - first))
                self._shaders.finish.draw(textures, numbers)
                done = pace.wait()
            if done:
                yield
        with _drawing(images.batch):
            picture, depths = images.batch.read(0), images.batch.read(1)
        color, rest = np.ascontiguousarray(picture[..., :3]), (depths[..., 0], picture[..., 3], depths[..., 1])
        return RenderedView(color, *(np.ascontiguousarray(a) for a in rest))


class _drawing:
    """A target bound for drawing over all of it, with nothing of another drawing's state but what is given back after."""

    def __init__(self, target: Target, blend: str = "NONE") -> None:
        self._bound, self._blend, self._target = target.buffer.bind(), blend, target

    def __enter__(self) -> None:
        self._bound.__enter__()
        gpu.state.viewport_set(0, 0, self._target.width, self._target.height)
        gpu.state.blend_set(self._blend)
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        gpu.state.face_culling_set("NONE")
        gpu.state.color_mask_set(True, True, True, True)
        gpu.state.scissor_test_set(False)

    def __exit__(self, *error: object) -> None:
        gpu.state.blend_set("NONE")
        gpu.state.scissor_test_set(False)
        self._bound.__exit__(*error)


def _view_block(request: ViewRequest) -> gpu.types.GPUUniformBuf:
    k = request.intrinsics
    values = np.zeros((6, 4), np.float32)
    values[:3, :3] = request.pose.R.T
    values[3] = k.fx, k.fy, k.cx, k.cy
    margin = 0.5 * c.JACOBIAN_MARGIN * np.array([k.width / k.fx, k.height / k.fy])
    values[4, :2] = np.array([-k.cx / k.fx, -k.cy / k.fy]) - margin
    values[4, 2:] = np.array([(k.width - k.cx) / k.fx, (k.height - k.cy) / k.fy]) + margin
    values[5, :3] = k.width, k.height, len(request.points)
    return gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", values.size, values.ravel()))
