"""The lens of a photo that nobody has calibrated: by its EXIF data, or by what most cameras have. A start for the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from ..geometry.camera import Intrinsics
from ..geometry.conventions import focal_px_from_35mm
from .photo import Photo, PhotoFacts, photo_facts

# Across the long side; about 35 mm on full frame, which lies between a phone's wide lens and a normal one.
DEFAULT_FOV_DEG = 55.0


@dataclass(frozen=True)
class LensGuess:
    """`intrinsics` belong to the photo at its full size, upright; `focal_35mm` is EXIF's, None where the default was taken;
    `orientation` as in Photo.
    """

    intrinsics: Intrinsics
    focal_35mm: float | None
    orientation: int = 1

    @property
    def assumption(self) -> str:
        """What was assumed, as part of a sentence."""
        if self.focal_35mm is None:
            return f"{DEFAULT_FOV_DEG:g} degrees across the long side are assumed, for the photo tells no focal length"
        return f"{self.focal_35mm:.3g} mm (35 mm equivalent) are taken from the photo's EXIF"


def guess_lens(photo: Photo) -> LensGuess:
    """The lens that a photo's own data, or else habit, suggest."""
    return _guess(photo)


def guess_lens_of_file(path: Path) -> LensGuess:
    """As `guess_lens`, of a file whose pixels need not be decoded for it. Raises PhotoError when it is no photo."""
    return _guess(photo_facts(path))


def guess_lens_of_size(width: int, height: int) -> LensGuess:
    """The guess for a photo of that size that tells nothing of its lens."""
    return _guess(PhotoFacts(width, height, None))


def _guess(photo: Photo | PhotoFacts) -> LensGuess:
    width, height, focal_35mm = photo.width, photo.height, photo.focal_35mm
    pixel = photo.pixel_aspect if isinstance(photo, Photo) else 1.0
    # The focal length in heights of a pixel, of which the picture is so many across as it is shown.
    if focal_35mm is None:
        focal = max(width * pixel, height) / 2 / math.tan(math.radians(DEFAULT_FOV_DEG / 2))
    else:
        focal = focal_px_from_35mm(focal_35mm, width * pixel, height)
    return LensGuess(Intrinsics(width, height, focal / pixel, focal, width / 2, height / 2), focal_35mm, photo.orientation)
