"""Sentences in the sidebar: broken into lines that fit its width, and cut where there is room for some of them only."""

from __future__ import annotations

from collections.abc import Sequence

import blf
import bpy

FONT_POINTS = 11  # The size of Blender's labels at a scale of 1.
MARGIN_PX = 62  # What tabs, panel and box take of the sidebar's width at a scale of 1.
ICON_PX = 22
MORE = " \u2026"


def room_px(context: bpy.types.Context, icon: bool = False) -> float:
    """The width that a line of text has in a box of the sidebar, at a scale of 1."""
    return context.region.width / context.preferences.system.ui_scale - MARGIN_PX - (ICON_PX if icon else 0)


def lines(text: str, room: float) -> list[str]:
    """The text in lines of at most `room` pixels; a word that is wider is broken."""
    found, line = [], ""
    for word in text.split():
        longer = f"{line} {word}" if line else word
        if fits(longer, room):
            line = longer
            continue
        found += [line] if line else []
        *whole, line = _broken(word, room)
        found += whole
    return [*found, line] if line else found


def _broken(word: str, room: float) -> list[str]:
    """The word in parts that fit, each with at least one letter."""
    parts = []
    while len(word) > 1 and not fits(word, room):
        count = next((n for n in range(len(word) - 1, 1, -1) if fits(word[:n], room)), 1)
        parts.append(word[:count])
        word = word[count:]
    return [*parts, word]


def fits(text: str, room: float) -> bool:
    """Whether the text is no wider than `room` pixels."""
    return _width(text) <= room


def fitted(texts: Sequence[str], room: float, count: int) -> list[str]:
    """Exactly `count` lines: as much of the texts as they hold, then empty ones. Where something is left out, "…" says so."""
    found = [line for text in texts for line in lines(text, room)]
    if len(found) > count:
        last = found[count - 1]
        while last and not fits(last + MORE, room):
            last = last[:-1].rstrip()
        return [*found[: count - 1], last + MORE]
    return found + [""] * (count - len(found))


def _width(text: str) -> float:
    blf.size(0, FONT_POINTS)
    return blf.dimensions(0, text)[0]
