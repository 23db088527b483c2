"""SuperPoint (DeTone, Malisiewicz and Rabinovich, CVPRW 2018) from an ONNX file, through OpenCV's dnn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...errors import FeatureError
from ...geometry.conventions import from_opencv_pixels
from ..nets.input import inside, pad_to_multiple, unit_rows
from ..types import Features, Grey, Mask, no_features

STEP_PX = 8
OUTPUTS = ("keypoints", "scores", "descriptors")


@dataclass(frozen=True)
class SuperPoint:
    """SuperPoint extractor with the network in `model` (.onnx with grey `image` -> `keypoints`, `scores`, `descriptors`)."""

    model: Path
    max_features: int = 2048

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of `grey` (H, W) uint8. Raises cv2.error or FeatureError when the model does not work."""
        height, width = grey.shape
        image = pad_to_multiple(grey, STEP_PX).astype(np.float32) / 255
        # The network is read for every image, for the reason given in `Disk`.
        net = cv2.dnn.readNetFromONNX(str(self.model))
        if net.empty():
            raise FeatureError("It holds operators that OpenCV does not know.")
        net.setInput(image[None, None], "image")
        outputs: Sequence[Any] = net.forward(list(OUTPUTS))
        # OpenCV returns None for an output that has no rows.
        if any(out is None for out in outputs):
            return no_features((width, height), 256)
        points, scores, rows = (np.asarray(out) for out in outputs)
        count = scores.size
        if points.size != 2 * count or (count and rows.size % count):
            raise FeatureError(f"Its outputs {points.shape}, {scores.shape}, {rows.shape} are not those of SuperPoint.")
        if count and np.abs(points).max() < 2:
            raise FeatureError("Its places run from -1 to 1, as ALIKED's do, and SuperPoint's are pixels.")
        if count == 0:
            return no_features((width, height), 256)
        xy = from_opencv_pixels(points.reshape(count, 2))
        found = Features(xy, unit_rows(rows.reshape(count, -1).astype(np.float32)), (width, height))
        strongest = np.argsort(-scores.ravel(), kind="stable")[: self.max_features]
        found = found.take(strongest)
        return found.take(inside(found.keypoints, (width, height))).where(mask)
