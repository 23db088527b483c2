"""What a render says of the scan's surface at places between its pixels: one way for all stages."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray
from ...geometry.conventions import to_opencv_pixels
from ...render.view import RenderedView
from .matches import BoolArray

# Below this alpha a pixel of the render shows the background as much as the scan.
MIN_ALPHA = 0.5
# No rendered depth is believed to be known better than to this share of it.
MIN_DEPTH_STD_RATIO = 1e-3


def solid_part(view: RenderedView) -> BoolArray:
    """Which pixels (H, W) of a render show the scan."""
    return np.asarray(view.alpha >= MIN_ALPHA)


def depth_at(view: RenderedView, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Depth (N,) at `pixels` (N, 2), camera-space z in scene units, NaN where the render shows no scan; and its standard
    deviation (N,) along the pixel's ray.

    Between pixels depth and variance are averaged as the renderer averages Gaussians, by their share of the pixel: beside the
    scan's edge an empty pixel, whose depth is 0, then counts for nothing.
    """
    alpha = sample(view.alpha, pixels)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(alpha > MIN_ALPHA, sample(view.alpha * view.depth, pixels) / alpha, np.nan)
        variance = sample(view.alpha * view.depth_variance, pixels) / alpha
        std = np.sqrt(np.maximum(variance, 0.0))
    return depth, np.maximum(std, MIN_DEPTH_STD_RATIO * depth)


def sample(image: NDArray[np.float32], pixels: FloatArray) -> FloatArray:
    """`image` (H, W) at `pixels` (N, 2), bilinear, as float64 (N,)."""
    if len(pixels) == 0:
        return np.zeros(0)
    places = np.ascontiguousarray(to_opencv_pixels(pixels), np.float32)
    values = cv2.remap(image, places[:, :1], places[:, 1:], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float64).ravel()
