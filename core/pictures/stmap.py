"""ST maps: two-channel pictures that say, for each pixel, where in another picture to look.

In Nuke's convention: red is s, from 0 at the left to 1 at the right edge, green is t, from 0 at the bottom to 1 at the top; the
centre of pixel (i, j), j from the top, has s = (i + 0.5) / width and t = 1 - (j + 0.5) / height.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import PhotoError
from ..geometry.camera import FloatArray, Intrinsics
from ..geometry.conventions import pixel_centres, to_opencv_pixels
from ..geometry.pinhole_cut import central_cut
from ..geometry.wide_lens import WideLens
from ..photos.containers.openexr import read_exr, write_exr
from ..photos.photo import Photo

Map = NDArray[np.float32]  # (H, W, 2): s and t
# A place outside of every picture.
NOWHERE = -1.0
S, T = "R", "G"
SEEN = 254
# So many rows are worked out at a time, because those of a whole photo would take several gigabytes.
ROWS = 64
# OpenCV resamples no larger picture.
MAX_SIDE = 32_766


def straight_lens(lens: Intrinsics | WideLens) -> Intrinsics:
    """The pinhole of the undistorted picture: of the photo's size, or the cut of a wide lens. Raises CameraError."""
    return central_cut(lens).intrinsics if isinstance(lens, WideLens) else lens.pinhole()


def undistort_map(lens: Intrinsics | WideLens) -> Map:
    """Where each pixel of the undistorted picture looks in the photo; NOWHERE where the photo does not show it."""
    k = straight_lens(lens)

    def looks(pixels: FloatArray) -> FloatArray:
        return lens.project(np.column_stack([k.normalise(pixels), np.ones(len(pixels))]))

    return _map(looks, (lens.width, lens.height), (k.width, k.height))


def distort_map(lens: Intrinsics | WideLens, straight: Intrinsics | None = None) -> Map:
    """Where each pixel of the photo looks in the undistorted picture; NOWHERE where that does not show it.

    `straight`: the pinhole of that picture; `straight_lens` gives it where there is none.
    """
    k = straight or straight_lens(lens)

    def looks(pixels: FloatArray) -> FloatArray:
        if isinstance(lens, WideLens):
            return k.project(lens.unproject(pixels))
        return k.project(np.column_stack([lens.normalise(pixels), np.ones(len(pixels))]))

    return _map(looks, (k.width, k.height), (lens.width, lens.height))


def write_stmap(path: Path, stmap: Map) -> None:
    """As 32-bit floats. Raises OSError."""
    write_exr(path, {S: stmap[..., 0], T: stmap[..., 1]})


def read_stmap(path: Path) -> Map:
    """Raises PhotoError when the file can't be read or lacks a channel."""
    channels = read_exr(path)
    if S not in channels or T not in channels:
        raise PhotoError(f"'{path.name}' has the channels {', '.join(channels)}; an ST map has {S} and {T}.")
    return np.stack([channels[S], channels[T]], axis=-1)


def through_map(photo: Photo, stmap: Map, name: str) -> Photo:
    """The undistorted picture that an ST map makes of a photo; what it does not show is masked. `name` is the map's.

    Raises PhotoError when the map looks nowhere in the photo, is too large, or EXIF turns the photo.
    """
    height, width = photo.pixels.shape[:2]
    if not photo.stored_upright:
        raise PhotoError(f"The photo is turned by its EXIF data, and '{name}' is not; save the photo upright.")
    if max(height, width, *stmap.shape) > MAX_SIDE:
        raise PhotoError(f"The photo or '{name}' has a side of more than {MAX_SIDE} pixels; make both smaller.")
    inside = (np.isfinite(stmap) & (stmap > 0) & (stmap < 1)).all(axis=2)
    if not inside.any():
        raise PhotoError(f"'{name}' looks nowhere into the photo; its values should lie between 0 and 1.")
    flat = np.where(inside[..., None], stmap, NOWHERE) * np.array([1, -1]) + np.array([0, 1])
    at = to_opencv_pixels(flat * (width, height)).astype(np.float32)
    pixels = cv2.remap(photo.pixels, at[..., 0], at[..., 1], cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
    if photo.mask is not None:
        seen = cv2.remap(photo.mask.astype(np.uint8) * np.uint8(255), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        inside &= seen >= SEEN
    note = f"The photo is used as the ST map '{name}' undistorts it; its camera is that of the undistorted picture."
    mask = None if inside.all() else inside
    return replace(photo, pixels=np.asarray(pixels, np.uint8), mask=mask, full_size=None, notes=(*photo.notes, note))


def _map(looks: Callable[[FloatArray], FloatArray], looked_at: tuple[int, int], size: tuple[int, int]) -> Map:
    """The map of a picture of `size`, whose pixels (N, 2) look at those that `looks` gives of a picture of size `looked_at`."""
    width, height = size
    out = np.empty((height, width, 2), np.float32)
    for top in range(0, height, ROWS):
        count = min(ROWS, height - top)
        x, y = np.meshgrid(pixel_centres(width), pixel_centres(count, top))
        s, t = (looks(np.stack([x.ravel(), y.ravel()], axis=1)) / looked_at).T
        both = np.stack([s, 1 - t], axis=1)
        seen = np.isfinite(both).all(axis=1, keepdims=True)
        out[top : top + count] = np.where(seen, both, NOWHERE).reshape(count, width, 2)
    return out
