"""Marks over the viewport: crosses, rings, lines and words, in the region's pixels from below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

Place = tuple[float, float]
Colour = tuple[float, float, float, float]
RING, CROSS, DOT = 7.0, 6.0, 16  # radius, half length (px), corners of a ring
TEXT_PX = 13
SHADOW: Colour = (0.0, 0.0, 0.0, 0.8)


@dataclass(frozen=True)
class Marks:
    """`rings` and `crosses` are places, `lines` pairs of them, `words` places with their text; each with its colour."""

    rings: list[tuple[Place, Colour]] = field(default_factory=list)
    crosses: list[tuple[Place, Colour]] = field(default_factory=list)
    lines: list[tuple[Place, Place, Colour]] = field(default_factory=list)
    words: list[tuple[Place, str, Colour]] = field(default_factory=list)


def draw(marks: Marks) -> None:
    """Draws in the region of the moment; for a handler of type POST_PIXEL."""
    scale = bpy.context.preferences.system.ui_scale
    parts = [(_ring(place, RING * scale), colour) for place, colour in marks.rings]
    parts += [(_cross(place, CROSS * scale), colour) for place, colour in marks.crosses]
    parts += [([one, other], colour) for one, other, colour in marks.lines]
    gpu.state.blend_set("ALPHA")
    for width, shadow in ((4.0, True), (2.0, False)):  # A dark rim makes the marks seen on any picture.
        gpu.state.line_width_set(width * scale)
        for points, colour in parts:
            _lines(points, SHADOW if shadow else colour)
    gpu.state.line_width_set(1.0)
    gpu.state.blend_set("NONE")
    for place, text, colour in marks.words:
        _word((place[0] + 10 * scale, place[1] + 8 * scale), text, colour, TEXT_PX * scale)


def _ring(middle: Place, radius: float) -> list[Place]:
    turns = [2 * math.pi * k / DOT for k in range(DOT + 1)]
    around = [(middle[0] + radius * math.cos(a), middle[1] + radius * math.sin(a)) for a in turns]
    return [point for pair in pairwise(around) for point in pair]


def _cross(middle: Place, half: float) -> list[Place]:
    (x, y) = middle
    return [(x - half, y), (x + half, y), (x, y - half), (x, y + half)]


def _lines(points: Sequence[Place], colour: Colour) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": [(x, y, 0.0) for x, y in points]})
    shader.bind()
    shader.uniform_float("color", colour)
    batch.draw(shader)


def _word(place: Place, text: str, colour: Colour, size: float) -> None:
    blf.size(0, size)
    for shift, tone in (((1, -1), SHADOW), ((0, 0), colour)):
        blf.position(0, place[0] + shift[0], place[1] + shift[1], 0)
        blf.color(0, *tone)
        blf.draw(0, text)
