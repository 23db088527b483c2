"""The shaders, all by create_from_info, which Metal, Vulkan and OpenGL take alike. Main thread, with a GPU context."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.render import constants as c
from .tables import CUT_MARGIN, SHAPE_TEXELS, TABLE_WIDTH, texels_per_gaussian

FOLDER = Path(__file__).parent / "shaders"
SQUARE = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
VIEW_BLOCK = "struct GssmcSeen { vec4 turn[3]; vec4 lens; vec4 limits; vec4 sizes; };\n"
NUMBERS: dict[str, float] = {
    "LOWPASS": c.LOWPASS_PX2,
    "ALPHA_MIN": c.ALPHA_MIN,
    "ALPHA_MAX": c.ALPHA_MAX,
    "TRANSMITTANCE_MIN": c.TRANSMITTANCE_MIN,
    "LOG_255": -float(np.log(c.ALPHA_MIN)),
    "CUT_MARGIN": CUT_MARGIN,
    "SH_C0": c.SH_C0,
    "SH_C1": c.SH_C1,
    **{f"SH_C2_{k}": value for k, value in enumerate(c.SH_C2)},
    **{f"SH_C3_{k}": value for k, value in enumerate(c.SH_C3)},
}
Textures = Mapping[str, gpu.types.GPUTexture]


@dataclass(frozen=True)
class Pass:
    """A shader's sides: the files of its two stages, its samplers, its whole-number constants, and the names of its targets."""

    vertex: str
    fragment: str
    samplers: Sequence[str]
    targets: Sequence[str]
    integers: Sequence[str] = ()
    floats: Sequence[str] = ()


COPY = Pass("full", "copy", ("part_tex",), ("texel",), ("first_row",))
PROJECT = Pass("full", "project", ("scan_tex", "points_tex"), ("bounds", "form", "light"))
SPLAT = Pass(
    "splat",
    "splat",
    ("bounds_tex", "form_tex", "light_tex", "state_tex"),
    ("light", "depths"),
    ("last", "width", "height"),
    ("depth0",),
)
JOIN = Pass(
    "full",
    "join",
    ("light_tex", "state_tex", "batch_light_tex", "batch_depth_tex"),
    ("light", "state"),
    ("batch",),
    ("depth0",),
)
FINISH = Pass(
    "full",
    "finish",
    ("light_tex", "state_tex", "bounds_tex", "form_tex", "splat_light_tex"),
    ("picture", "depths"),
    ("batch_size", "count"),
)


class Shader:
    """A compiled pass and the square that it is drawn with. Raises Blender's own exception where it does not compile."""

    def __init__(self, sides: Pass, defines: Mapping[str, str], block: bool = False) -> None:
        self._sides = sides
        info = gpu.types.GPUShaderCreateInfo()
        for name, value in {"TABLE_WIDTH": str(TABLE_WIDTH), **defines}.items():
            info.define(name, value)
        for name, number in NUMBERS.items():
            info.define(name, f"({number:.9g})" if "." in f"{number:.9g}" else f"({number:.9e})")
        if block:
            info.typedef_source(VIEW_BLOCK)
            info.uniform_buf(0, "GssmcSeen", "view")
        for slot, name in enumerate(sides.samplers):
            info.sampler(slot, "FLOAT_2D", name)
        for name in sides.integers:
            info.push_constant("INT", name)
        for name in sides.floats:
            info.push_constant("FLOAT", name)
        info.vertex_in(0, "VEC2", "corner")
        if sides.vertex == "splat":
            between = gpu.types.GPUStageInterfaceInfo("gssmc_render_between")
            for name in ("centre", "form", "rgb"):
                between.flat("VEC4", name)
            info.vertex_out(between)
        for slot, name in enumerate(sides.targets):
            info.fragment_out(slot, "VEC4", name)
        info.vertex_source((FOLDER / f"{sides.vertex}.vert.glsl").read_text(encoding="utf-8"))
        info.fragment_source((FOLDER / f"{sides.fragment}.frag.glsl").read_text(encoding="utf-8"))
        self._shader = gpu.shader.create_from_info(info)
        self._square = batch_for_shader(self._shader, "TRI_STRIP", {"corner": SQUARE})

    def draw(
        self,
        textures: Sequence[gpu.types.GPUTexture],
        numbers: Mapping[str, int | float] | None = None,
        instances: int = 0,
        block: gpu.types.GPUUniformBuf | None = None,
    ) -> None:
        """Draws over the bound framebuffer: `textures` in the order of the samplers; 0 instances: one square, not instanced."""
        shader = self._shader
        shader.bind()
        for name, texture in zip(self._sides.samplers, textures, strict=True):
            shader.uniform_sampler(name, texture)
        for name, value in (numbers or {}).items():
            (shader.uniform_int if name in self._sides.integers else shader.uniform_float)(name, value)
        if block is not None:
            shader.uniform_block("view", block)
        if instances:
            self._square.draw_instanced(shader, instance_start=0, instance_count=instances)
        else:
            self._square.draw(shader)


class Shaders:
    """All passes; each is compiled when it is first asked for."""

    def __init__(self) -> None:
        self._project: dict[tuple[int, bool], Shader] = {}

    @cached_property
    def copy(self) -> Shader:
        return Shader(COPY, {})

    @cached_property
    def splat(self) -> Shader:
        return Shader(SPLAT, {})

    @cached_property
    def join(self) -> Shader:
        return Shader(JOIN, {})

    @cached_property
    def finish(self) -> Shader:
        return Shader(FINISH, {})

    def compiled(self, coefficients: int, antialiased: bool) -> Iterator[Shader]:
        """All that such scans need, each compiled when it is asked for."""
        yield self.copy
        yield self.project(coefficients, antialiased)
        yield self.splat
        yield self.join
        yield self.finish

    def project(self, coefficients: int, antialiased: bool) -> Shader:
        """The projection of scans with so many SH coefficients to a channel."""
        key = (coefficients, antialiased)
        if key not in self._project:
            texels = texels_per_gaussian(coefficients)
            defines = {"SH_COUNT": coefficients, "SH_TEXELS": texels - SHAPE_TEXELS, "TEXELS": texels}
            defines |= {"ANTIALIASED": 1} if antialiased else {}
            self._project[key] = Shader(PROJECT, {name: str(value) for name, value in defines.items()}, block=True)
        return self._project[key]
