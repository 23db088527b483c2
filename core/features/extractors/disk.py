"""DISK: learned features (Tyszkiewicz, Fua and Trulls, NeurIPS 2020), through OpenCV's cv2.DISK."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...geometry.conventions import from_opencv_pixels
from ..nets.input import inside, pad_to_multiple, unit_rows
from ..types import Features, Grey, Mask, no_features
from .opencv import detect

STEP_PX = 16


@dataclass(frozen=True)
class Disk:
    """DISK extractor with the network in `model` (.onnx with `image` -> `keypoints`, `scores`, `descriptors`)."""

    model: Path
    max_features: int = 2048

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8. Raises cv2.error when the model does not work."""
        height, width = grey.shape
        padded = pad_to_multiple(grey, STEP_PX)
        # A network per image: its number of keypoints changes, and a reused one then gives wrong values.
        disk = cv2.DISK.create(str(self.model), self.max_features, 0.0, (padded.shape[1], padded.shape[0]))
        points, descriptors = detect(disk, cv2.cvtColor(padded, cv2.COLOR_GRAY2BGR))
        if descriptors is None:
            return no_features((width, height), 1)
        xy = from_opencv_pixels([point.pt for point in points])
        found = Features(xy, unit_rows(descriptors.astype(np.float32)), (width, height))
        return found.take(inside(xy, (width, height))).where(mask)
