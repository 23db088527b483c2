"""ORB: oriented FAST corners with binary descriptors (Rublee et al., ICCV 2011)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...geometry.conventions import HALF_PIXEL
from ..types import Features, Grey, Mask, no_features
from .opencv import detect

DESCRIPTOR_BYTES = 32
MIN_SIDE_PX = 64  # the border that ORB leaves out, on both sides
SCALE = 1.2
LEVELS = 8
# Half of OpenCV's default, because renders are softer than photos.
FAST_THRESHOLD = 10


@dataclass(frozen=True)
class Orb:
    """ORB extractor; `max_features` keeps the strongest."""

    max_features: int = 4000

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8, descriptors (N, 32) uint8. An image without structure gives an empty set."""
        size = (grey.shape[1], grey.shape[0])
        if min(size) < MIN_SIDE_PX:
            return no_features(size, DESCRIPTOR_BYTES, binary=True)
        orb = cv2.ORB.create(self.max_features, SCALE, LEVELS, fastThreshold=FAST_THRESHOLD)
        points, descriptors = detect(orb, grey)
        if descriptors is None:
            return no_features(size, DESCRIPTOR_BYTES, binary=True)
        # OpenCV multiplies a level's pixel index by the level's scale, though it is the pixel's edge that scales: with the
        # centre of the first pixel at 0.5 the place is (index + 0.5) * scale.
        scale = SCALE ** np.array([point.octave for point in points], np.float64)[:, None]
        xy = np.array([point.pt for point in points], np.float64) + HALF_PIXEL * scale
        return Features(xy, descriptors.astype(np.uint8), size).where(mask)
