"""AKAZE: features of a non-linear scale space with binary descriptors (Alcantarilla, Nuevo and Bartoli, BMVC 2013)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...geometry.conventions import from_opencv_pixels
from ..types import Features, Grey, Mask, no_features
from .opencv import detect

DESCRIPTOR_BYTES = 61
# The patch of a descriptor does not fit into a smaller image.
MIN_SIDE_PX = 32


@dataclass(frozen=True)
class Akaze:
    """AKAZE extractor. `max_features` keeps the strongest; `threshold` is that of the detector's response."""

    max_features: int = 4000
    # A fifth of OpenCV's default, because renders are softer than photos.
    threshold: float = 2e-4

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8, descriptors (N, 61) uint8. An image without structure gives an empty set."""
        size = (grey.shape[1], grey.shape[0])
        if min(size) < MIN_SIDE_PX:
            return no_features(size, DESCRIPTOR_BYTES, binary=True)
        akaze = cv2.xfeatures2d.AKAZE.create(threshold=self.threshold)  # OpenCV 5 moved it there from cv2
        points, descriptors = detect(akaze, grey)
        if descriptors is None:
            return no_features(size, DESCRIPTOR_BYTES, binary=True)
        xy = from_opencv_pixels([point.pt for point in points])
        found = Features(xy, descriptors.astype(np.uint8), size)
        strongest = np.argsort([-point.response for point in points], kind="stable")[: self.max_features]
        return found.take(strongest).where(mask)
