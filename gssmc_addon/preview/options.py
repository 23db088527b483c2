"""What a preview can look like; for the operator and for the panel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

STYLES = (
    ("SIDE_BY_SIDE", "Side by Side", "Photo left, render right"),
    (
        "DIAGONAL",
        "Diagonal",
        "The photo above the diagonal, the render below it: edges run on across it where the camera is right",
    ),
    ("WIPE", "Wipe", "The photo left of a line that you can move, the render right of it"),
    ("SQUARES", "Squares", "Photo and render in turn, as on a chessboard"),
    ("DIFFERENCE", "Difference", "Dark where photo and render agree, bright where they differ; exposure is evened out"),
    ("RENDER", "Render", "The splat alone, as the photo's camera sees it"),
    ("FLICKER", "Flicker", "Photo and render in turn, twice a second"),
    ("MATCHES", "Matches", "The features by which both are recognised in each other: green where they sit at the same place"),
)
# The styles whose picture has the photo's own shape.
IN_VIEWPORT = ("DIAGONAL", "WIPE", "SQUARES", "DIFFERENCE", "RENDER", "FLICKER")


Update = Callable[[Any, bpy.types.Context], None]


def preview_annotations(
    update: Update | None = None, position_update: Update | None = None, background_update: Update | None = None
) -> dict[str, object]:
    """The options as Blender properties, with what is called when the style, the wipe's line, or its place is changed."""
    return {
        "style": EnumProperty(
            name="Style",
            items=STYLES,
            default="DIAGONAL",
            description="How photo and render are set against each other",
            update=update,
        ),
        "position": FloatProperty(
            name="Position",
            description="Where the wipe's line stands: 0 all render, 1 all photo",
            default=0.5,
            min=0,
            max=1,
            subtype="FACTOR",
            update=position_update,
        ),
        "background": BoolProperty(
            name="Show in Viewport",
            description="Show the picture where the viewport looks through the camera, until the camera is moved; an Image "
            "Editor, where one is open, shows it too",
            default=True,
            update=background_update,
        ),
        "long_side_px": IntProperty(
            name="Long Side (px)",
            description="Size of the preview; never larger than the photo",
            default=1280,
            min=64,
            max=8192,
        ),
    }
