"""A photo looked at turned and enlarged as well, for learned features that know neither a rolled camera nor another distance.

SIFT finds its points whatever their turn and size; ALIKED, DISK and SuperPoint lose most matches beyond 20 degrees of roll or
a factor of 1.5. Copies of the photo bring that back at the price of a few more extractions, of the photo only.
`benchmarks/features.py` shows what it is worth.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..geometry.camera import FloatArray
from ..geometry.conventions import from_opencv_pixels, to_opencv_pixels
from .types import Extractor, Features, Grey, Mask


@dataclass(frozen=True)
class Looks:
    """An Extractor of photos that joins what `extractor` finds in the photo with what it finds in turned and scaled copies.

    Each of `rolls_deg` comes at each of `scales`. For one side of a pair only: the mutual nearest neighbour then picks, for
    every feature of the render, the look that resembles it most.
    """

    extractor: Extractor
    rolls_deg: tuple[float, ...] = (0.0, -25.0, 25.0)
    scales: tuple[float, ...] = (1.0, 1.6)

    def extract(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of all looks at `grey` (H, W) uint8, in its own pixels. Errors are those of `extractor`."""
        found = [self._look(grey, roll, scale) for scale in self.scales for roll in self.rolls_deg]
        some = [look for look in found if len(look)] or found[:1]
        points = np.concatenate([look.keypoints for look in some])
        rows = np.concatenate([look.descriptors for look in some])
        return Features(points, rows, (grey.shape[1], grey.shape[0])).where(mask)

    def _look(self, grey: Grey, roll_deg: float, scale: float) -> Features:
        """The features of one copy, at their places in `grey`; none from its margins, which show nothing of the photo."""
        if roll_deg == 0 and scale == 1:
            return self.extractor.extract(grey)
        height, width = grey.shape
        size, there = copy_map(width, height, roll_deg, scale)
        # The same map, between pixels as OpenCV counts them.
        centred = there.copy()
        centred[:, 2] = to_opencv_pixels(there[:, :2] @ from_opencv_pixels((0.0, 0.0)) + there[:, 2])
        copy = cv2.warpAffine(grey, centred, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        found = self.extractor.extract(np.asarray(copy, np.uint8))
        places = (found.keypoints - there[:, 2]) @ np.linalg.inv(there[:, :2]).T
        inner = ((places >= 0) & (places < (width, height))).all(axis=1)
        return Features(places, found.descriptors).take(np.asarray(inner))


def copy_map(width: int, height: int, roll_deg: float, scale: float) -> tuple[tuple[int, int], FloatArray]:
    """Size (width, height) of the copy that holds the whole turned image, and the map (2, 3) from the image's pixels to the
    copy's, the centre of either's top-left pixel at (0.5, 0.5).
    """
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    turn = scale * np.array([[c, -s], [s, c]])
    box = np.ceil(np.abs(turn) @ (width, height) - 1e-6)
    shift = box / 2 - turn @ (width / 2, height / 2)
    return (int(box[0]), int(box[1])), np.column_stack([turn, shift])
