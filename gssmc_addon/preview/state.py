"""What the panel keeps of the preview, on the window manager and hence never saved."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from . import flicker
from . import options as preview_options


def _style_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import restyle  # Imported here, because that module needs the properties, which need this one.

    restyle.style_changed(self, context)


def _position_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import restyle

    restyle.position_changed(self, context)


def _background_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import images as preview_images
    from . import restyle

    if self.background:
        restyle.style_changed(self, context)
    else:
        preview_images.show_in_viewport(None, None)


class GssmcPreview(bpy.types.PropertyGroup):
    """The preview's options as the panel shows them, and whether the flicker runs."""

    __annotations__ = {
        **preview_options.preview_annotations(_style_changed, _position_changed, _background_changed),
        "flicker": BoolProperty(
            name="Flicker", description="Shows photo and render in turn, twice a second", default=False, update=flicker.changed
        ),
    }
