"""Drawing with Blender's gpu module: shaders, textures, and the two passes of one viewport.

First the splats go into a float buffer of their own, blended in display-encoded colours as they were trained, hidden by what
the viewport says stands before them. Then the buffer goes over the viewport. viewport_canvas says when which is done.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...core.render.constants import LOWPASS_PX2
from .data import TABLE_WIDTH, SplatTables
from .front import MOST, FrontPicture

SHADERS = Path(__file__).parent / "shaders"
SQUARE = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
VIEW_BLOCK = "struct SplatView { mat4 view_model; mat4 projection; vec2 size; float near; float boost; vec4 more; };\n"
OVER_BLOCK = "struct SplatsOver { vec4 across[4]; vec4 up[4]; vec4 more; };\n"  # MOST pictures
SLOW = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")


def is_software() -> bool:
    """True when the processor does the graphics card's work."""
    renderer = gpu.platform.renderer_get().lower()
    return gpu.platform.device_type_get() == "SOFTWARE" or any(word in renderer for word in SLOW)


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
        """Whether all tables are on the graphics card."""
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
    object's matrix into the view, the view's projection, and `stamp`, which changes whenever `order` or textures do.
    """

    textures: SplatTextures
    order: gpu.types.GPUTexture
    count: int
    boost: float
    view_model: Matrix
    projection: Matrix
    stamp: Any

    def key(self) -> Any:
        """A value that is equal exactly where the same picture would be drawn."""
        matrices = (self.view_model, self.projection)
        return self.stamp, self.count, self.boost, tuple(tuple(row) for matrix in matrices for row in matrix)


@dataclass(frozen=True)
class Ground:
    """What the splats are drawn on: its size in pixels, and the viewport's depth with its pixels to one of the ground's."""

    size: tuple[int, int]
    depth: gpu.types.GPUTexture | None = None
    depth_step: int = 1


@dataclass(frozen=True)
class Before:
    """A picture before the scene with its texture: straight alpha, over the picture's own 0..1; `drawn`: what is drawn in the
    viewport, over the whole region, as `read_colour` has it.
    """

    picture: FrontPicture
    pixels: gpu.types.GPUTexture
    drawn: bool = False


class Painter:
    """The shaders; made inside a draw, where a GPU context exists. Raises Blender's own exception when they do not compile."""

    def __init__(self) -> None:
        self._splat, self._overlay = _splat_shader(), _overlay_shader()
        self._quad = batch_for_shader(self._splat, "TRI_STRIP", {"corner": SQUARE})
        self._screen = batch_for_shader(self._overlay, "TRI_STRIP", {"corner": SQUARE})
        self._no_depth = texture(np.ones((1, 1), np.float32))

    def draw_splats(self, draw: SplatDraw, ground: Ground, part: range | None = None) -> None:
        """Blends a splat, or a part of its ordered Gaussians, over the bound framebuffer."""
        part = range(draw.count) if part is None else part
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        shader = self._splat
        shader.bind()
        shader.uniform_sampler("depth_tex", ground.depth or self._no_depth)
        # The buffer has to live until the draw, because the shader does not hold it.
        block = _view_block(draw, ground, part.start)
        shader.uniform_block("view", block)
        shader.uniform_sampler("order_tex", draw.order)
        for name, item in draw.textures.samplers.items():
            shader.uniform_sampler(name, item)
        self._quad.draw_instanced(shader, instance_start=0, instance_count=len(part))
        gpu.state.blend_set("NONE")

    def with_textures(self, pictures: Sequence[FrontPicture]) -> list[Before]:
        """The pictures with their textures, inside a draw of their viewport."""
        screen, found = None, []
        self._overlay.bind()  # Making a texture binds the previous shader again, which must still exist.
        for picture in pictures:
            if picture.image is not None:
                found.append(Before(picture, gpu.texture.from_image(picture.image)))
            else:
                screen = screen or texture(read_colour())
                found.append(Before(picture, screen, True))
        return found

    def lay_over(self, splats: gpu.types.GPUTexture, opacity: float, before: Sequence[Before] = ()) -> None:
        """The finished splats over the bound framebuffer, stretched to its size, below the pictures before the scene."""
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("NONE")
        self._overlay.bind()
        block = _over_block(opacity, before)  # It has to live until the draw, as above.
        self._overlay.uniform_block("over", block)
        self._overlay.uniform_sampler("splats_tex", splats)
        for k in range(MOST):
            self._overlay.uniform_sampler(f"picture_{k}_tex", before[k].pixels if k < len(before) else self._no_depth)
        self._screen.draw(self._overlay)
        gpu.state.blend_set("NONE")


def _view_block(draw: SplatDraw, ground: Ground, first: int) -> gpu.types.GPUUniformBuf:
    near = draw.textures.near * draw.view_model.median_scale
    depth_step = ground.depth_step if ground.depth else 0
    values = [*_columns(draw.view_model), *_columns(draw.projection), *ground.size, near, draw.boost, depth_step, first, 0, 0]
    return gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", len(values), np.array(values, np.float32)))


def _over_block(opacity: float, before: Sequence[Before]) -> gpu.types.GPUUniformBuf:
    rows = np.zeros((2 * MOST + 1, 4), np.float32)
    for k, item in enumerate(before):
        rows[k], rows[MOST + k] = (*item.picture.place[0], item.drawn), (*item.picture.place[1], item.picture.alpha)
    rows[-1, :2] = opacity, len(before)
    return gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", rows.size, rows.ravel()))


def _columns(matrix: Matrix) -> list[float]:
    return [value for column in matrix.transposed() for value in column]


def read_colour() -> np.ndarray:
    """What is drawn in the bound framebuffer's viewport, (height, width, 4): light times alpha, then display-encoded."""
    left, bottom, width, height = gpu.state.viewport_get()
    buffer = gpu.state.active_framebuffer_get().read_color(left, bottom, width, height, 4, 0, "FLOAT")
    return np.array(buffer, np.float32, copy=True).reshape(height, width, 4)


def _splat_shader() -> gpu.types.GPUShader:
    between = gpu.types.GPUStageInterfaceInfo("gssmc_splat_between")
    between.smooth("VEC2", "offset")
    between.flat("VEC4", "color")
    info = gpu.types.GPUShaderCreateInfo()
    info.typedef_source(VIEW_BLOCK)  # Two matrices do not fit into the push constants of every graphics card.
    info.uniform_buf(0, "SplatView", "view")
    for slot, name in enumerate(("place_tex", "shape_tex", "color_tex", "order_tex", "depth_tex")):
        info.sampler(slot, "FLOAT_2D", name)
    info.define("TABLE_WIDTH", str(TABLE_WIDTH))
    info.define("LOWPASS", str(LOWPASS_PX2))
    info.vertex_in(0, "VEC2", "corner")
    info.vertex_out(between)
    return _made(info, "splat")


def _overlay_shader() -> gpu.types.GPUShader:
    between = gpu.types.GPUStageInterfaceInfo("gssmc_overlay_between")
    between.smooth("VEC2", "place")
    info = gpu.types.GPUShaderCreateInfo()
    info.typedef_source(OVER_BLOCK)
    info.uniform_buf(0, "SplatsOver", "over")
    info.sampler(0, "FLOAT_2D", "splats_tex")
    for k in range(MOST):
        info.sampler(1 + k, "FLOAT_2D", f"picture_{k}_tex")
    info.vertex_in(0, "VEC2", "corner")
    info.vertex_out(between)
    return _made(info, "overlay")


def _made(info: gpu.types.GPUShaderCreateInfo, name: str) -> gpu.types.GPUShader:
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source((SHADERS / f"{name}.vert.glsl").read_text(encoding="utf-8"))
    info.fragment_source((SHADERS / f"{name}.frag.glsl").read_text(encoding="utf-8"))
    return gpu.shader.create_from_info(info)
