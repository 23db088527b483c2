"""SIFT with the RootSIFT normalisation (Arandjelovic and Zisserman, CVPR 2012)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...geometry.conventions import from_opencv_pixels
from ..types import Features, Grey, Mask, no_features
from .opencv import detect

DESCRIPTOR_SIZE = 128
# SIFT's pyramid finds nothing in a smaller image.
MIN_SIDE_PX = 16


@dataclass(frozen=True)
class RootSift:
    """RootSIFT extractor. `max_features` 0 keeps all; `contrast` is SIFT's contrast threshold (low finds faint corners)."""

    max_features: int = 4000
    contrast: float = 0.02

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8. An image without structure gives an empty set."""
        size = (grey.shape[1], grey.shape[0])
        if min(size) < MIN_SIDE_PX:
            return no_features(size, DESCRIPTOR_SIZE)
        sift = cv2.SIFT.create(nfeatures=self.max_features, contrastThreshold=self.contrast, enable_precise_upscale=True)
        points, descriptors = detect(sift, grey)
        if descriptors is None:
            return no_features(size, DESCRIPTOR_SIZE)
        xy = from_opencv_pixels([point.pt for point in points])
        root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12))
        return Features(xy, root.astype(np.float32), size).where(mask)
