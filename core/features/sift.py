"""SIFT with the RootSIFT normalisation (Arandjelovic and Zisserman, CVPR 2012)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .types import Features

DESCRIPTOR_SIZE = 128
MIN_SIDE_PX = 16  # SIFT's pyramid has nothing to find in less


@dataclass(frozen=True)
class RootSift:
    """RootSIFT extractor. `max_features` 0 keeps all; `contrast` is SIFT's contrast threshold (low finds faint corners)."""

    max_features: int = 4000
    contrast: float = 0.02

    def extract(self, grey: NDArray[np.uint8], mask: NDArray[np.bool_] | None = None) -> Features:
        """Features of `grey` (H, W) uint8. An image without structure gives an empty set."""
        if min(grey.shape) < MIN_SIDE_PX:
            return _empty()
        sift = cv2.SIFT.create(nfeatures=self.max_features, contrastThreshold=self.contrast)
        points, descriptors = sift.detectAndCompute(np.ascontiguousarray(grey), None)
        if descriptors is None or len(points) == 0:
            return _empty()
        # OpenCV puts the centre of the first pixel at 0; this is the one place where that is turned to 0.5.
        xy = np.array([point.pt for point in points], np.float64) + 0.5
        root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12))
        if mask is not None:
            cell = np.clip(xy.astype(np.intp), 0, (grey.shape[1] - 1, grey.shape[0] - 1))
            keep = mask[cell[:, 1], cell[:, 0]]
            xy, root = xy[keep], root[keep]
        return Features(xy, root.astype(np.float32))


def _empty() -> Features:
    return Features(np.zeros((0, 2)), np.zeros((0, DESCRIPTOR_SIZE), np.float32))
