"""Linear light (OpenEXR) as the pixels of a photo: exposed, and encoded as sRGB with 8 bits."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import PhotoError
from ..size import reduction

# So large a share of the pixels is darker than what becomes white.
WHITE_SHARE = 0.99
LINEAR_END, LINEAR_SLOPE, POWER, SCALE, OFFSET = 0.0031308, 12.92, 1 / 2.4, 1.055, 0.055  # the sRGB curve, IEC 61966-2-1


@dataclass(frozen=True, eq=False)
class ExposedLight:
    """`pixels` (H, W, 3) uint8; `mask`, `notes`, `full_size` and `pixel_aspect` as in Photo."""

    pixels: NDArray[np.uint8]
    mask: NDArray[np.bool_] | None
    notes: tuple[str, ...]
    full_size: tuple[int, int] | None
    pixel_aspect: float


def expose(light: NDArray[np.float32], pixel_aspect: float = 1.0) -> ExposedLight:
    """The pixels of `light` (H, W, 4) float32, linear red, green, blue and alpha, row 0 on top.

    Light has no white of its own: the brightest hundredth of the pixels becomes white. Values that are not finite, and pixels
    with an alpha of 0, are masked. Raises PhotoError when nothing is left to see.
    """
    height, width = light.shape[:2]
    factor = reduction((width, height))
    if factor > 1:
        light = np.asarray(cv2.resize(light, (width // factor, height // factor), interpolation=cv2.INTER_AREA))
    seen = np.isfinite(light).all(axis=2) & (light[..., 3] > 0)
    colour = np.where(seen[..., None], light[..., :3], 0)
    white = float(np.quantile(colour.max(axis=2)[seen], WHITE_SHARE)) if seen.any() else 0.0
    if white <= 0:
        raise PhotoError("The photo is black or transparent throughout; choose another one.")
    notes = ["The photo holds linear light; its brightest hundredth is used as white."]
    if factor > 1:
        notes.append(f"The photo has {width} x {height} pixels; every {factor} x {factor} of them are used as one.")
    if not seen.all():
        notes.append("Pixels of the photo that are transparent or not finite are left out.")
    pixels = np.rint(srgb(np.clip(colour / np.float32(white), 0, 1)) * 255).astype(np.uint8)
    if pixel_aspect != 1:
        notes.append(f"Its pixels are {pixel_aspect:.4g} times as wide as high, as its file says.")
    mask, full = None if seen.all() else seen, (width, height) if factor > 1 else None
    return ExposedLight(pixels, mask, tuple(notes), full, pixel_aspect)


def from_srgb(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values of sRGB's curve, from 0, to linear ones. The inverse of `srgb`."""
    curved = np.power((np.maximum(values, 0) + OFFSET) / SCALE, 1 / POWER)
    return np.where(values <= LINEAR_SLOPE * LINEAR_END, values / LINEAR_SLOPE, curved).astype(np.float32)


def srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear values 0..1 to sRGB's."""
    curved = SCALE * np.power(linear, POWER) - OFFSET
    return np.where(linear <= LINEAR_END, LINEAR_SLOPE * linear, curved).astype(np.float32)
