"""The lens of the photo on the CG: how much more the render has to show, and the map that bends it."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.geometry.camera import Intrinsics
from ...core.pictures.overscan import overscanned
from ...core.pictures.stmap import distort_map

MAP_NAME = "GS-SMC Lens"


def map_image(lens: Intrinsics, ratio: float) -> bpy.types.Image:
    """An image inside the .blend that says of each pixel of the photo where the render shows it, as Map UV wants it.

    The render shows `ratio` times as much as the photo. Places that it does not show lie outside of 0..1, and stay bare.
    """
    where = distort_map(lens, overscanned(lens, ratio))
    image = bpy.data.images.new(MAP_NAME, lens.width, lens.height, alpha=True, float_buffer=True, is_data=True)
    pixels = np.ones((lens.height, lens.width, 4), np.float32)  # 4.5 takes the third channel for the opacity.
    pixels[..., :2] = where[::-1]  # Blender stores the bottom row first.
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image
