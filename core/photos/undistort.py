"""A photo as a pinhole camera would have taken it, for programs that know no lens distortion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Intrinsics
from ..geometry.conventions import pixel_centres, to_opencv_pixels
from .photo import Photo

# So many rows are mapped at a time, because the map of a whole photo would take several times its memory.
ROWS = 256


def undistorted(photo: Photo, lens: Intrinsics) -> Photo:
    """The photo through `lens.pinhole()`: same size, focal length and centre. `lens` belongs to the photo at its full size.

    What the lens did not see is black. The photo itself where the lens has no distortion.
    """
    if not lens.has_distortion:
        return photo
    height, width = photo.pixels.shape[:2]
    k = lens.resized(width, height)
    pixels = np.empty_like(photo.pixels)
    for top in range(0, height, ROWS):
        pixels[top : top + ROWS] = _rows(photo.pixels, k, top, min(ROWS, height - top))
    return replace(photo, pixels=pixels, mask=None)


def _rows(pixels: NDArray[np.uint8], k: Intrinsics, top: int, count: int) -> NDArray[Any]:
    x, y = np.meshgrid(pixel_centres(k.width), pixel_centres(count, top))
    ideal = np.stack([(x.ravel() - k.cx) / k.fx, (y.ravel() - k.cy) / k.fy], axis=1)
    bent = k.distort_normalised(ideal) * (k.fx, k.fy) + (k.cx, k.cy)
    at = to_opencv_pixels(bent).reshape(count, k.width, 2).astype(np.float32)
    return np.asarray(cv2.remap(pixels, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT))
