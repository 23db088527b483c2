"""Pictures that show how well a photo sits on the splat."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera
from ..photos.photo import Photo
from ..render.view import ViewRenderer
from .compare import Comparison, render_photo_like, squares

Image = NDArray[np.uint8]

BANNER_PX = 28


def chessboard(renderer: ViewRenderer, photo: Photo, camera: Camera) -> Image:
    """Photo and render in turn (H, W, 3) uint8 RGB, as on a chessboard: edges break at the squares where the camera is wrong.

    The render is bent by the camera's lens like the photo; `camera.intrinsics` must have the photo's size.
    """
    render, solid = render_photo_like(renderer, camera)
    return squares(Comparison(photo.pixels, render, solid))


def before_after(renderer: ViewRenderer, photo: Photo, start: Camera, refined: Camera) -> Image:
    """The chessboards of the start and of the refined camera side by side, each with a line above it."""
    panels = [
        _titled(chessboard(renderer, photo, camera), title)
        for camera, title in ((start, "before: photo and splat in turn"), (refined, "after"))
    ]
    gap = np.full((panels[0].shape[0], 8, 3), 255, np.uint8)
    return np.concatenate([panels[0], gap, panels[1]], axis=1)


def _titled(image: Image, title: str) -> Image:
    banner = np.full((BANNER_PX, image.shape[1], 3), 255, np.uint8)
    cv2.putText(banner, title, (8, BANNER_PX - 9), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (20, 20, 20), 1, cv2.LINE_AA)
    return np.concatenate([banner, image])


def save_png(path: str, image: Image) -> None:
    """Writes an RGB image (H, W, 3) uint8. Raises OSError when it cannot be written."""
    ok, data = cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))
    if not ok:
        raise OSError(f"The picture could not be encoded for '{path}'.")
    with open(path, "wb") as file:
        file.write(data.tobytes())
