"""Pinhole pictures out of a photo that was taken through a wide lens."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import PhotoError
from ...geometry.camera import FloatArray
from ...geometry.conventions import pixel_centres, to_opencv_pixels
from ...geometry.pinhole_cut import PinholeCut, central_cut
from ...geometry.wide_lens import WideLens
from ..photo import Photo

# So many rows are mapped at a time, because the map of a whole photo would take several times its memory.
ROWS = 256
# A panorama goes on at its other side; so many pixels of it are put there for the filter.
SEAM = 8
OUTSIDE = -1e6
# From this level (of 255) on, what the filter makes of a mask counts as seen: no pixel that is not takes part.
SEEN = 254


@dataclass(frozen=True, eq=False)
class CutPhoto:
    """A pinhole picture and the cut that it shows."""

    photo: Photo
    cut: PinholeCut


def cut_photo(photo: Photo, lens: WideLens, cut: PinholeCut) -> CutPhoto:
    """The photo as the pinhole camera of `cut` would have taken it. `lens` belongs to the photo's `pixels`.

    What the photo does not show is masked, and so is what its own mask leaves out; rows and columns at the edges that show
    nothing are left out of the cut. Raises PhotoError when nothing is seen.
    """
    source = _Source.of(photo, lens)
    k = cut.intrinsics
    pixels = np.empty((k.height, k.width, 3), np.uint8)
    seen = np.empty((k.height, k.width), bool)
    for top in range(0, k.height, ROWS):
        count = min(ROWS, k.height - top)
        at = source.places(_rays(cut, top, count)).reshape(count, k.width, 2).astype(np.float32)
        pixels[top : top + count] = _resampled(source.pixels, at, cv2.INTER_LANCZOS4)
        seen[top : top + count] = cv2.remap(source.seen, at[..., 0], at[..., 1], cv2.INTER_LINEAR) >= SEEN
    whole = replace(photo, pixels=pixels, mask=seen, full_size=None, focal_35mm=None, orientation=1)
    return _trimmed(whole, seen, cut)


def central_photo(photo: Photo, lens: WideLens) -> CutPhoto:
    """The pinhole picture of the photo's middle, with a note that it is one. `lens` belongs to the photo at its full size.

    Raises PhotoError of a panorama, which has no middle that stands for it, and CameraError where the lens shows nothing.
    """
    if lens.is_panorama:
        name = Path(photo.file).name or "The photo"
        raise PhotoError(f"'{name}' is a panorama, which the command 'refine' places from a start with R and t, and no other.")
    pixels = lens_of_pixels(photo, lens)
    made = cut_photo(photo, pixels, central_cut(pixels))
    note = f"The photo is used through a pinhole cut of {made.cut.degrees:.0f} degrees out of its lens {lens.model}."
    return replace(made, photo=replace(made.photo, notes=(*photo.notes, note)))


def lens_of_pixels(photo: Photo, lens: WideLens) -> WideLens:
    """The lens at the size of the photo's pixels, which may be fewer than its own."""
    height, width = photo.pixels.shape[:2]
    return lens.resized(width, height)


@dataclass(frozen=True, eq=False)
class _Source:
    """The photo's pixels and, as 0 or 255, which of them show something, with the seam of a panorama closed by `seam` more."""

    lens: WideLens
    pixels: NDArray[np.uint8]
    seen: NDArray[np.uint8]
    seam: int

    @classmethod
    def of(cls, photo: Photo, lens: WideLens) -> _Source:
        shape = photo.pixels.shape[:2]
        seen = np.full(shape, 255, np.uint8) if photo.mask is None else photo.mask.astype(np.uint8) * np.uint8(255)
        if not lens.is_panorama:
            return cls(lens, photo.pixels, seen, 0)
        pixels, seen = (
            np.asarray(cv2.copyMakeBorder(cv2.copyMakeBorder(one, 0, 0, SEAM, SEAM, cv2.BORDER_WRAP), *POLES), np.uint8)
            for one in (photo.pixels, seen)
        )
        return cls(lens, pixels, seen, SEAM)

    def places(self, rays: FloatArray) -> FloatArray:
        """Where in `pixels` the rays (N, 3) lie, as OpenCV counts, (N, 2); OUTSIDE for those that the photo does not show."""
        at = to_opencv_pixels(self.lens.project(rays)) + self.seam
        return np.asarray(np.where(np.isfinite(at), at, OUTSIDE))


def _trimmed(photo: Photo, seen: NDArray[np.bool_], cut: PinholeCut) -> CutPhoto:
    """The picture without the margins in which nothing is seen, with its camera."""
    if seen.all():
        return CutPhoto(replace(photo, mask=None), cut)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    if not len(rows):
        raise PhotoError("The photo shows nothing where its lens looks; check its mask and its lens.")
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    k, inside = cut.intrinsics, seen[top:bottom, left:right]
    trimmed = replace(k, width=right - left, height=bottom - top, cx=k.cx - left, cy=k.cy - top)
    pixels = np.ascontiguousarray(photo.pixels[top:bottom, left:right])
    mask = None if inside.all() else np.ascontiguousarray(inside)
    return CutPhoto(replace(photo, pixels=pixels, mask=mask), replace(cut, intrinsics=trimmed))


POLES = (SEAM, SEAM, 0, 0, cv2.BORDER_REPLICATE)


def _rays(cut: PinholeCut, top: int, count: int) -> FloatArray:
    """Directions (count * width, 3) of the photo's camera through the pixels of some rows of the cut."""
    k = cut.intrinsics
    x, y = np.meshgrid(pixel_centres(k.width), pixel_centres(count, top))
    rays = np.column_stack([(x.ravel() - k.cx) / k.fx, (y.ravel() - k.cy) / k.fy, np.ones(x.size)])
    return np.asarray(rays @ cut.turn)


def _resampled(pixels: NDArray[np.uint8], at: NDArray[np.float32], how: int) -> NDArray[np.uint8]:
    """The pixels at places (H, W, 2); the edge goes on beyond it, for an edge of black would be matched."""
    return np.asarray(cv2.remap(pixels, at[..., 0], at[..., 1], how, borderMode=cv2.BORDER_REPLICATE), np.uint8)
