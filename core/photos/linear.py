"""Photos with linear light (OpenEXR) as the engine takes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .containers.light import expose
from .photo import Photo


def photo_from_linear(light: NDArray[np.float32], file: str = "", pixel_aspect: float = 1.0) -> Photo:
    """The photo of `light` (H, W, 4) float32, linear red, green, blue and alpha, row 0 on top, as `light.expose` shows it;
    `pixel_aspect` as in Photo. Raises PhotoError when nothing is left to see.
    """
    shown = expose(light, pixel_aspect)
    return Photo(shown.pixels, file, None, shown.mask, shown.notes, shown.full_size, pixel_aspect=pixel_aspect)
