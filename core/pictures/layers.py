"""A render of the splat as the layers of a compositor: light, opacity and depth, in the units and names that Blender has."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..photos.containers.light import from_srgb
from ..photos.containers.openexr import Channel, write_exr
from ..render.view import RenderedView

# How far Blender puts what is not there.
NOTHING = 1e10
COLOUR = ("Splat.Combined.R", "Splat.Combined.G", "Splat.Combined.B", "Splat.Combined.A")
DEPTH = "Splat.Depth.Z"
# Below this opacity a pixel counts as empty.
FAINT = 1 / 255


def layers_of(view: RenderedView, unit: float) -> dict[str, Channel]:
    """Linear light times opacity, opacity, and the depth along the camera's axis; `unit`: of the depth, in the scan's units.

    A splat has its colours as a screen shows them, in sRGB; they become light, so that Blender shows them as they were.
    """
    there = np.maximum(view.alpha, np.float32(FAINT))[..., None]
    light = from_srgb(np.asarray(view.color / there, np.float32)) * view.alpha[..., None]
    depth = np.where(view.alpha > FAINT, view.depth * np.float32(unit), np.float32(NOTHING))
    return {name: light[..., k] for k, name in enumerate(COLOUR[:3])} | {COLOUR[3]: view.alpha, DEPTH: depth}


def write_layers(path: Path, view: RenderedView, unit: float) -> None:
    """A multilayer OpenEXR file: 16 bits of light and opacity, 32 of depth. Raises OSError."""
    write_exr(path, layers_of(view, unit), half=COLOUR, packed=True)
