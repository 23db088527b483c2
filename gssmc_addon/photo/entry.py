"""One line of the list of photos, as it is kept in the .blend on the scene."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, PointerProperty, StringProperty


class GssmcPhoto(bpy.types.PropertyGroup):
    """A photo of the list: its camera, which holds photo and verdict; or, without one, the file that could not be used."""

    __annotations__ = {
        "camera": PointerProperty(
            name="Camera",
            description="The camera of this photo",
            type=bpy.types.Object,
            poll=lambda self, obj: obj.type == "CAMERA",
        ),
        "file": StringProperty(name="File", description="The file of a photo that could not be read"),
        "error": StringProperty(name="Error", description="Why the photo could not be read or refined"),
        "note": StringProperty(name="Note", description="How the photo was found, or what was tried, in a second pass"),
        "lens_group": StringProperty(
            name="Lens Group",
            description="Photos with the same name here share one lens. Empty: those of the same camera, lens, focal length "
            "and size, as their EXIF says",
        ),
        "ticked": BoolProperty(name="Ticked", description="Refine Ticked takes this photo", default=True),
    }
