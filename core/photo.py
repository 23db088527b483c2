"""The photograph as the engine takes it: upright 8-bit RGB pixels, and what EXIF says of the lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Photo:
    """`pixels` (H, W, 3) uint8 RGB, upright (EXIF rotation applied), still lens-distorted.

    `focal_35mm`: 35 mm equivalent focal length from EXIF in mm, None when absent.
    `mask`: (H, W) bool, True where the photo has content (alpha > 0); None when every pixel has.
    `notes`: sentences about what was done to the pixels on reading (16-bit scaled, alpha dropped, rotated).
    """

    pixels: NDArray[np.uint8]
    file: str = ""
    focal_35mm: float | None = None
    mask: NDArray[np.bool_] | None = None
    notes: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])
