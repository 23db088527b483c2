"""Images as networks take them: sides that are multiples of what the network halves by, and the way back to pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..types import Grey


def pad_to_multiple(grey: Grey, step: int) -> Grey:
    """`grey` (H, W) continued to the right and below by its last pixels, so that both sides are multiples of `step`.

    Padding leaves every pixel where it is; resizing instead would blur and stretch the image.
    """
    height, width = grey.shape
    down, right = -height % step, -width % step
    if not (down or right):
        return np.ascontiguousarray(grey)
    return np.asarray(cv2.copyMakeBorder(grey, 0, down, 0, right, cv2.BORDER_REPLICATE), np.uint8)


def inside(xy: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which points (N, 2) lie in an image of `size` (width, height): not in its padding, and not NaN.

    The centre of the top-left pixel is at (0.5, 0.5).
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(((xy >= 0) & (xy < np.array(size))).all(axis=1))


def unit_rows(descriptors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rows scaled to length 1; a row of zeros stays."""
    length = np.linalg.norm(descriptors, axis=1, keepdims=True)
    return np.asarray(descriptors / np.maximum(length, 1e-12), np.float32)
