"""The photo at the size that a stage works at: scaled, undistorted, and with its contrast evened out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...features.subpixel import normalise_locally
from ...geometry.camera import Intrinsics
from ...geometry.conventions import opencv_matrix
from ...photos.photo import Photo
from .matches import BoolArray

GreyImage = NDArray[np.uint8]

# A photo with fewer grey levels between its darkest and its brightest hundredth of pixels is underexposed or hazy.
NARROW = 96.0
# The percentiles between which the contrast is measured.
TAILS = (1.0, 99.0)
# The grey levels that these two percentiles are stretched to.
STRETCHED = (16.0, 239.0)


@dataclass(frozen=True, eq=False)
class WorkingPhoto:
    """`intrinsics` with distortion; `raw` (H, W) uint8 grey as the lens drew it; `mask` (H, W) bool, True where the photo may
    be used, None when everywhere; `grey` the undistorted `raw`, `aligned` the same locally normalised; `usable` (H, W) bool
    the undistorted mask. photo_px: how many pixels of the photo as it is one pixel of this picture spans.
    """

    intrinsics: Intrinsics
    raw: GreyImage
    mask: BoolArray | None
    grey: GreyImage
    aligned: GreyImage
    usable: BoolArray | None
    photo_px: float = 1.0

    @property
    def pinhole(self) -> Intrinsics:
        return self.intrinsics.pinhole()

    @classmethod
    def of(cls, photo: Photo, intrinsics: Intrinsics, long_side_px: int) -> WorkingPhoto:
        """`photo` and its camera scaled down to a long side of `long_side_px`."""
        work = intrinsics.with_long_side(long_side_px)
        size = (work.width, work.height)
        mask = None
        if photo.mask is not None:
            mask = cv2.resize(photo.mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        scale = max(intrinsics.width, intrinsics.height) / max(size)
        return cls._made(work, exposed(photo.pixels, size, mask), mask, scale)

    @classmethod
    def _made(cls, k: Intrinsics, raw: GreyImage, mask: BoolArray | None, photo_px: float) -> WorkingPhoto:
        grey = undistorted(raw, k, cv2.INTER_CUBIC)
        usable = None if mask is None else undistorted(mask.astype(np.uint8), k, cv2.INTER_NEAREST) > 0
        return cls(k, raw, mask, grey, normalise_locally(grey), usable, photo_px)

    def with_intrinsics(self, k: Intrinsics) -> WorkingPhoto:
        """The same pixels under other intrinsics. The photo is undistorted anew only where either of them has distortion."""
        if not (k.has_distortion or self.intrinsics.has_distortion):
            return replace(self, intrinsics=k)
        return self._made(k, self.raw, self.mask, self.photo_px)


def exposed(pixels: NDArray[np.uint8], size: tuple[int, int], mask: BoolArray | None) -> GreyImage:
    """The photo `pixels` (H, W, 3) RGB as grey of `size` (width, height), its contrast stretched where it is narrow.

    Detectors have absolute thresholds: of a photo at a tenth of the right exposure SIFT keeps nothing. What `mask` (the size
    of the result) leaves out does not count; a photo without any contrast stays as it is.
    """
    grey = _scaled(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), size)
    usable = mask if mask is not None and mask.any() else np.ones(grey.shape, bool)
    low, high = np.percentile(grey[usable], TAILS)
    if high - low >= NARROW or high <= low:
        return np.asarray(grey, np.uint8)
    # The photo is reduced once more in floating point, because averaging finds levels between those that rounding left.
    fine = _scaled(cv2.cvtColor(pixels.astype(np.float32), cv2.COLOR_RGB2GRAY), size)
    low, high = np.percentile(fine[usable], TAILS)
    bottom, top = STRETCHED
    fine = (fine - low) * ((top - bottom) / max(high - low, 1.0)) + (bottom + 0.5)
    return np.asarray(np.clip(fine, 0, 255), np.uint8)


def _scaled(image: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    return image if image.shape[1::-1] == size else np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def undistorted(image: GreyImage, intrinsics: Intrinsics, interpolation: int) -> GreyImage:
    """`image` as `intrinsics.pinhole()` would have seen it."""
    if not intrinsics.has_distortion:
        return image
    K = opencv_matrix(intrinsics)
    size = (intrinsics.width, intrinsics.height)
    map_x, map_y = cv2.initUndistortRectifyMap(K, np.asarray(intrinsics.dist), np.eye(3), K, size, cv2.CV_32FC1)
    return np.asarray(cv2.remap(image, map_x, map_y, interpolation), np.uint8)
