"""Drawing with Blender's gpu module: shaders, textures, and the two passes of one viewport.

First all splats go into a float buffer of the region's size, blended in display-encoded colours as they were trained, hidden by
what the viewport's depth says stands before them. Then the buffer goes over the viewport. As long as neither view nor depth
change, the first pass is left out: redraws for other reasons stay cheap.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..core.render.constants import LOWPASS_PX2
from .viewport_data import TABLE_WIDTH, SplatTables

SHADERS = Path(__file__).parent / "shaders"
SQUARE = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
VIEW_BLOCK = "struct SplatView { mat4 view_model; mat4 projection; vec2 size; float near; float boost; vec4 use_depth; };\n"
SLOW = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")


def is_software() -> bool:
    """True when the processor does the graphics card's work."""
    renderer = gpu.platform.renderer_get().lower()
    return any(word in renderer for word in SLOW)


def largest_count() -> int:
    """How many Gaussians the textures can hold."""
    side = gpu.capabilities.max_texture_size_get()
    return TABLE_WIDTH * side if side >= TABLE_WIDTH else 0


def texture(table: np.ndarray) -> gpu.types.GPUTexture:
    """A float texture of a table (H, W) or (H, W, 4)."""
    data = np.ascontiguousarray(table, np.float32)
    buffer = gpu.types.Buffer("FLOAT", data.size, data.ravel())
    kind = "R32F" if data.ndim == 2 else "RGBA32F"
    return gpu.types.GPUTexture((data.shape[1], data.shape[0]), format=kind, data=buffer)


class SplatTextures:
    """The tables of one splat on the graphics card, sent one at a time so that no redraw takes long."""

    def __init__(self, tables: SplatTables) -> None:
        self.count, self.near, self.means = tables.count, tables.near, tables.means
        self._left = [("place_tex", tables.place), ("shape_tex", tables.shape), ("color_tex", tables.color)]
        self.samplers: dict[str, gpu.types.GPUTexture] = {}

    @property
    def complete(self) -> bool:
        return not self._left

    def send_next(self) -> bool:
        """Sends one more table; True when all are there."""
        if self._left:
            name, table = self._left.pop()
            self.samplers[name] = texture(table)
        return self.complete


@dataclass(frozen=True)
class SplatDraw:
    """One splat in one view: its textures, the `count` indices to draw in their order, how much to enlarge the Gaussians, the
    object's matrix into the view, and `stamp`, which changes whenever `order` or textures do.
    """

    textures: SplatTextures
    order: gpu.types.GPUTexture
    count: int
    boost: float
    view_model: Matrix
    stamp: Any

    def key(self) -> Any:
        return self.stamp, self.count, self.boost, tuple(tuple(row) for row in self.view_model)


class Painter:
    """The shaders; made inside a draw, where a GPU context exists. Raises what Blender raises when they do not compile."""

    def __init__(self) -> None:
        self._splat, self._overlay = _splat_shader(), _overlay_shader()
        self._quad = batch_for_shader(self._splat, "TRI_STRIP", {"corner": SQUARE})
        self._screen = batch_for_shader(self._overlay, "TRI_STRIP", {"corner": SQUARE})
        self._no_depth = texture(np.ones((1, 1), np.float32))

    def draw_splats(
        self, draw: SplatDraw, projection: Matrix, size: tuple[int, int], depth: gpu.types.GPUTexture | None = None
    ) -> None:
        """Blends a splat over the bound framebuffer of `size` pixels; `depth` (same size) hides what lies behind it."""
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        shader = self._splat
        shader.bind()
        shader.uniform_sampler("depth_tex", depth or self._no_depth)
        near = draw.textures.near * draw.view_model.median_scale
        values = [*_columns(draw.view_model), *_columns(projection), *size, near, draw.boost, depth is not None, 0, 0, 0]
        block = gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", len(values), np.array(values, np.float32)))
        shader.uniform_block("view", block)
        shader.uniform_sampler("order_tex", draw.order)
        for name, item in draw.textures.samplers.items():
            shader.uniform_sampler(name, item)
        self._quad.draw_instanced(shader, instance_start=0, instance_count=draw.count)
        gpu.state.blend_set("NONE")

    def lay_over(self, splats: gpu.types.GPUTexture, opacity: float) -> None:
        """The finished splats over the bound framebuffer, which must be of the same size."""
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("NONE")
        self._overlay.bind()
        self._overlay.uniform_float("opacity", opacity)
        self._overlay.uniform_sampler("splats_tex", splats)
        self._screen.draw(self._overlay)
        gpu.state.blend_set("NONE")


class Canvas:
    """One splat in one region as it was drawn last."""

    def __init__(self) -> None:
        self._buffer: gpu.types.GPUOffScreen | None = None
        self._key: Any = None
        self._depth: np.ndarray | None = None

    def paint(self, painter: Painter, draw: SplatDraw, projection: Matrix, opacity: float, depth: np.ndarray) -> bool:
        """Draws over the bound viewport, whose depth (H, W) was read; True when the splats had to be drawn anew."""
        size = (depth.shape[1], depth.shape[0])
        key = size, tuple(tuple(row) for row in projection), draw.key()
        fresh = key != self._key or self._depth is None or not np.array_equal(depth, self._depth)
        if fresh:
            buffer = self._sized(size)
            with buffer.bind():
                gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 0.0))
                painter.draw_splats(draw, projection, size, texture(depth))
            self._key, self._depth = key, depth
        if self._buffer:
            painter.lay_over(self._buffer.texture_color, opacity)
        return fresh

    def free(self) -> None:
        if self._buffer:
            self._buffer.free()
        self._buffer = self._key = self._depth = None

    def _sized(self, size: tuple[int, int]) -> gpu.types.GPUOffScreen:
        if self._buffer is None or (self._buffer.width, self._buffer.height) != size:
            self.free()
            self._buffer = gpu.types.GPUOffScreen(*size, format="RGBA16F")
        return self._buffer


def _columns(matrix: Matrix) -> list[float]:
    return [value for column in matrix.transposed() for value in column]


def read_depth() -> np.ndarray:
    """Depth of the bound framebuffer's viewport, (height, width), 1 where nothing stands."""
    left, bottom, width, height = gpu.state.viewport_get()
    buffer = gpu.state.active_framebuffer_get().read_depth(left, bottom, width, height)
    return np.array(buffer, np.float32, copy=True).reshape(height, width)


def _splat_shader() -> gpu.types.GPUShader:
    between = gpu.types.GPUStageInterfaceInfo("gssmc_splat_between")
    between.smooth("VEC2", "offset")
    between.flat("VEC4", "color")
    info = gpu.types.GPUShaderCreateInfo()
    info.typedef_source(VIEW_BLOCK)  # two matrices and more exceed what push constants hold everywhere
    info.uniform_buf(0, "SplatView", "view")
    for slot, name in enumerate(("place_tex", "shape_tex", "color_tex", "order_tex", "depth_tex")):
        info.sampler(slot, "FLOAT_2D", name)
    info.define("TABLE_WIDTH", str(TABLE_WIDTH))
    info.define("LOWPASS", str(LOWPASS_PX2))
    info.vertex_in(0, "VEC2", "corner")
    info.vertex_out(between)
    return _made(info, "splat")


def _overlay_shader() -> gpu.types.GPUShader:
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("FLOAT", "opacity")
    info.sampler(0, "FLOAT_2D", "splats_tex")
    info.vertex_in(0, "VEC2", "corner")
    return _made(info, "overlay")


def _made(info: gpu.types.GPUShaderCreateInfo, name: str) -> gpu.types.GPUShader:
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source((SHADERS / f"{name}.vert.glsl").read_text(encoding="utf-8"))
    info.fragment_source((SHADERS / f"{name}.frag.glsl").read_text(encoding="utf-8"))
    return gpu.shader.create_from_info(info)
