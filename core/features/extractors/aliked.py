"""ALIKED: learned features with deformable descriptors (Zhao et al., IEEE TIM 2023), through OpenCV's cv2.ALIKED."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...geometry.conventions import from_opencv_pixels
from ..nets.input import inside, pad_to_multiple, unit_rows
from ..types import Features, Grey, Mask, no_features
from .opencv import detect

# The network halves its input this far. For other sides, OpenCV returns wrong values without an error.
STEP_PX = 32
# The network has a fixed number of outputs; rows that are no local maximum fill them with scores near 0.
MIN_SCORE = 0.02


@dataclass(frozen=True)
class Aliked:
    """ALIKED extractor with the network in `model` (.onnx with `image` -> `keypoints`, `descriptors`, `scores`)."""

    model: Path

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8. Raises cv2.error when the model does not work."""
        height, width = grey.shape
        padded = pad_to_multiple(grey, STEP_PX)
        side = np.array([padded.shape[1], padded.shape[0]], np.float64)
        params = cv2.ALIKED_Params()  # type: ignore[attr-defined] # OpenCV's stubs leave it out
        params.inputSize = (padded.shape[1], padded.shape[0])
        # A network per image: reused, it gives wrong values as soon as the model's number of rows changes.
        points, descriptors = detect(cv2.ALIKED.create(str(self.model), params), cv2.cvtColor(padded, cv2.COLOR_GRAY2BGR))
        if descriptors is None:
            return no_features((width, height), 1)
        # The network counts from the first pixel's centre to the last one's, n = 2 x / (side - 1) - 1; OpenCV takes that for
        # edge to edge and returns (n + 1) / 2 * side, up to a pixel too far.
        xy = from_opencv_pixels(np.array([point.pt for point in points], np.float64) / side * (side - 1))
        strong = np.array([point.response for point in points]) >= MIN_SCORE
        found = Features(xy, unit_rows(descriptors.astype(np.float32)), (width, height))
        return found.take(strong & inside(xy, (width, height))).where(mask)
