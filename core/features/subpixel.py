"""Sub-pixel alignment of matches: Lucas-Kanade on locally normalised images.

A blob detector places its points about half a pixel apart in a photo and in a render of the same place, because the splat blurs
and the exposure differs. Aligning the patch around each match instead brings that below 0.2 px, and what cannot be aligned
there and back is no match. `benchmarks/real_scenes.py` shows what it does for the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray
from ..geometry.conventions import from_opencv_pixels, to_opencv_pixels

BoolArray = NDArray[np.bool_]

NORMALISE_SIGMA_PX = 5.0
# The number of grey levels that one local standard deviation becomes.
NORMALISE_GAIN = 40.0
# A variance (grey levels squared) that keeps flat regions from becoming amplified noise.
NORMALISE_FLOOR = 16.0
LK_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003)


@dataclass(frozen=True)
class SubpixelAligner:
    """Options: patch side, the farthest a point may move, and the largest there-and-back error, all in pixels; `levels`: how
    often the pictures are halved for places that are farther off than a patch reaches.
    """

    window_px: int = 19
    max_move_px: float = 2.0
    max_return_px: float = 0.3
    levels: int = 0

    def align(
        self, photo: NDArray[np.uint8], view: NDArray[np.uint8], photo_px: FloatArray, view_px: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """New places (N, 2) in `view` for the points `photo_px` (N, 2), first guessed at `view_px`, and which hold (N,).

        Both images come from `normalise_locally`; points are pixels with the centre of the top-left pixel at (0.5, 0.5).
        """
        if len(photo_px) == 0:
            return view_px, np.zeros(0, bool)
        there, ok_there = self._track(photo, view, photo_px, view_px)
        back, ok_back = self._track(view, photo, there, photo_px)
        moved = np.linalg.norm(there - view_px, axis=1)
        returned = np.linalg.norm(back - photo_px, axis=1)
        return there, ok_there & ok_back & (moved < self.max_move_px) & (returned < self.max_return_px)

    def _track(
        self, a: NDArray[np.uint8], b: NDArray[np.uint8], points: FloatArray, guess: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        start, first = (np.ascontiguousarray(to_opencv_pixels(p), np.float32).reshape(-1, 1, 2) for p in (points, guess))
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            a,
            b,
            start,
            first.copy(),
            winSize=(self.window_px, self.window_px),
            maxLevel=self.levels,
            criteria=LK_CRITERIA,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        return from_opencv_pixels(found.reshape(-1, 2)), status.ravel() > 0


def normalise_locally(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """`grey` (H, W) with local mean and contrast evened out, so that exposure and tone no longer move an alignment."""
    image = grey.astype(np.float32)
    centred = image - cv2.GaussianBlur(image, (0, 0), NORMALISE_SIGMA_PX)
    variance = cv2.GaussianBlur(centred * centred, (0, 0), NORMALISE_SIGMA_PX)
    scaled = 128 + NORMALISE_GAIN * centred / np.sqrt(variance + NORMALISE_FLOOR)
    return np.asarray(np.clip(scaled, 0, 255).astype(np.uint8))
