"""A pin as the .blend keeps it, on the data of its camera."""

from __future__ import annotations

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, IntProperty

from ...core.pose.pins.pin import MAX_WEIGHT

EVERY = -2_000_000  # no frame of Blender's: of a pin that was kept before pins knew theirs


class GssmcPin(bpy.types.PropertyGroup):
    """A pixel of the photo, and the point of the splat that the photo shows there."""

    __annotations__ = {
        "photo": FloatVectorProperty(
            name="Photo",
            description="Where in the photo it is: pixels of its own file, from the upper left corner",
            size=2,
            precision=2,
        ),
        "world": FloatVectorProperty(
            name="Point", description="The point of the splat, in the coordinates of its object", size=3, precision=4
        ),
        "weight": FloatProperty(
            name="Weight",
            description="How many clicks by hand it counts as",
            default=1.0,
            min=0.01,
            max=MAX_WEIGHT,
            soft_max=100.0,
        ),
        "frame": IntProperty(name="Frame", description="Of a plate, the frame of the scene at which it was set", default=EVERY),
        "error_px": FloatProperty(
            name="Error (px)", description="How far it lay off when the pins placed the camera last; -1: not yet", default=-1.0
        ),
    }
