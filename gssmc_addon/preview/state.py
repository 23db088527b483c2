"""What the panel keeps of the preview, on the window manager and hence never saved."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from . import flicker
from . import options as preview_options


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import job as preview_job  # it needs the properties, which need this module

    preview_job.restyle(self, context)


def _background_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import images as preview_images
    from . import job as preview_job

    if self.background:
        preview_job.restyle(self, context)
    else:
        preview_images.set_behind(None, None)


class GssmcPreview(bpy.types.PropertyGroup):
    """The preview's options as the panel shows them, and whether the flicker runs."""

    __annotations__ = {
        **preview_options.annotations(_changed, _background_changed),
        "flicker": BoolProperty(
            name="Flicker", description="Photo and render take turns in the Image Editor", default=False, update=flicker.changed
        ),
    }
