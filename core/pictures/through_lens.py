"""Images as the real lens would draw them: a pinhole render bent by the camera's distortion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, Intrinsics
from ..geometry.conventions import pixel_centres, to_opencv_pixels
from ..render.view import ViewRenderer

# A share of the image's side. A lens model that folds over would ask for an endless canvas.
MAX_PAD_RATIO = 1.0


def render_through_lens(renderer: ViewRenderer, camera: Camera, supersample: int = 1) -> NDArray[np.float32]:
    """Colour (H, W, 3) float32 of the camera's distorted image, black where the scene has nothing.

    With `supersample` > 1 the view is drawn that many times larger and averaged down, as a sensor's pixels average light.
    """
    k = camera.intrinsics
    large = k.resized(k.width * supersample, k.height * supersample)
    color: NDArray[Any]
    if not k.has_distortion:
        color = renderer.render(large, camera.pose).color
    else:
        canvas, at = _canvas(large)
        straight = renderer.render(canvas, camera.pose).color
        color = np.asarray(cv2.remap(straight, at[..., 0], at[..., 1], cv2.INTER_LINEAR))
    if supersample > 1:
        color = np.asarray(cv2.resize(color, (k.width, k.height), interpolation=cv2.INTER_AREA))
    return np.asarray(color, np.float32)


def _canvas(k: Intrinsics) -> tuple[Intrinsics, NDArray[np.float32]]:
    """A pinhole camera wide enough for every pixel of `k`, and where in it each pixel lies, (H, W, 2), OpenCV's origin."""
    x, y = np.meshgrid(pixel_centres(k.width), pixel_centres(k.height))
    straight = k.undistort(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(k.height, k.width, 2)
    size = np.array([k.width, k.height])
    low = np.clip(np.floor(straight.min(axis=(0, 1))) - 1, -MAX_PAD_RATIO * size, 0)
    high = np.clip(np.ceil(straight.max(axis=(0, 1))) + 1, size, (1 + MAX_PAD_RATIO) * size)
    width, height = (int(v) for v in high - low)
    canvas = replace(k.pinhole(), width=width, height=height, cx=k.cx - low[0], cy=k.cy - low[1])
    return canvas, to_opencv_pixels(straight - low).astype(np.float32)
