"""What the adapters of OpenCV's own detectors share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[Any]  # grey (H, W) or BGR (H, W, 3), uint8


def detect(detector: cv2.Feature2D, image: Image) -> tuple[Sequence[cv2.KeyPoint], NDArray[Any] | None]:
    """Keypoints, their `pt` with the centre of the first pixel at 0, and descriptors (N, D); None when there are none."""
    points, descriptors = detector.detectAndCompute(np.ascontiguousarray(image), None)
    if descriptors is None or len(points) == 0:
        return (), None
    return points, np.asarray(descriptors)
