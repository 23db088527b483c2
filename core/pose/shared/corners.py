"""Places of a photo that can be followed, and how evenly places cover it: one way for all stages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray
from ...geometry.conventions import from_opencv_pixels


@dataclass(frozen=True)
class CornerDetector:
    """Shi and Tomasi's corners: at most `count`, no weaker than `quality` times the strongest, `spacing_px` apart."""

    count: int
    quality: float
    spacing_px: float

    def detect(self, image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> FloatArray:
        """The corners (N, 2) of `image` (H, W), in pixels, where `mask` (H, W) is not 0; the strongest first."""
        # OpenCV returns None where it finds nothing, although its type stub denies it.
        corners: Any = cv2.goodFeaturesToTrack(image, self.count, self.quality, self.spacing_px, mask=mask)
        return np.zeros((0, 2)) if corners is None else from_opencv_pixels(np.reshape(corners, (-1, 2)))


def filled_cells(pixels: FloatArray, size: tuple[int, int], count: int) -> int:
    """How many of the `count` x `count` cells of an image of `size` (width, height) hold one of `pixels` (N, 2)."""
    return len(np.unique(np.clip(pixels / size * count, 0, count - 1).astype(int), axis=0))
