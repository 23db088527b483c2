"""The photo at the size that a stage works at: scaled, straightened, evened out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera import Intrinsics
from ..features.subpixel import normalise_locally
from ..photo import Photo
from .matches import BoolArray

GreyImage = NDArray[np.uint8]


@dataclass(frozen=True)
class WorkingPhoto:
    """`intrinsics` with distortion; `raw` (H, W) uint8 grey as the lens drew it; `mask` (H, W) bool, True where the photo may
    be used, None when everywhere; `grey` the undistorted `raw`, `aligned` the same locally normalised; `usable` (H, W) bool
    the undistorted mask.
    """

    intrinsics: Intrinsics
    raw: GreyImage
    mask: BoolArray | None
    grey: GreyImage
    aligned: GreyImage
    usable: BoolArray | None

    @property
    def pinhole(self) -> Intrinsics:
        return self.intrinsics.pinhole()

    @classmethod
    def of(cls, photo: Photo, intrinsics: Intrinsics, long_side_px: int) -> WorkingPhoto:
        """`photo` and its camera scaled down to a long side of `long_side_px`."""
        work = intrinsics.with_long_side(long_side_px)
        full = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
        size = (work.width, work.height)
        raw = np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA) if full.shape[::-1] != size else full, np.uint8)
        mask = None
        if photo.mask is not None:
            mask = cv2.resize(photo.mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        return cls._made(work, raw, mask)

    @classmethod
    def _made(cls, k: Intrinsics, raw: GreyImage, mask: BoolArray | None) -> WorkingPhoto:
        grey = undistorted(raw, k, cv2.INTER_CUBIC)
        usable = None if mask is None else undistorted(mask.astype(np.uint8), k, cv2.INTER_NEAREST) > 0
        return cls(k, raw, mask, grey, normalise_locally(grey), usable)

    def with_intrinsics(self, k: Intrinsics) -> WorkingPhoto:
        """The same pixels under another lens. Only a changed distortion or principal point costs a new straightening."""
        if not (k.has_distortion or self.intrinsics.has_distortion):
            return replace(self, intrinsics=k)
        return self._made(k, self.raw, self.mask)


def undistorted(image: GreyImage, intrinsics: Intrinsics, interpolation: int) -> GreyImage:
    """`image` as `intrinsics.pinhole()` would have seen it."""
    if not intrinsics.has_distortion:
        return image
    K = intrinsics.matrix
    K[:2, 2] -= 0.5  # OpenCV puts the centre of the first pixel at 0
    size = (intrinsics.width, intrinsics.height)
    map_x, map_y = cv2.initUndistortRectifyMap(K, np.asarray(intrinsics.dist), np.eye(3), K, size, cv2.CV_32FC1)
    return np.asarray(cv2.remap(image, map_x, map_y, interpolation), np.uint8)
