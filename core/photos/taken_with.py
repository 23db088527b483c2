"""Which camera and lens a photo was taken with, as its EXIF data say: photos of which all of it is equal share a lens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import PhotoError
from .exif import read_exif
from .photo import photo_facts


@dataclass(frozen=True, order=True)
class TakenWith:
    """Camera and lens by the names that the camera writes, the focal length (mm) and its 35 mm equivalent, 0 when unknown, the
    size upright, and how the camera was held (EXIF's orientation), for the principal point turns with the picture.
    """

    model: str
    lens: str
    focal_mm: float
    focal_35mm: float
    width: int
    height: int
    orientation: int

    def __str__(self) -> str:
        if self.focal_mm:
            return f"{self.model} at {self.focal_mm:.4g} mm"
        return f"{self.model} at {self.focal_35mm:.4g} mm (35 mm equivalent)"


def taken_with(path: str | Path) -> TakenWith | None:
    """What a photo's file says; None where it tells no camera or no focal length, or cannot be read."""
    try:
        exif = read_exif(Path(path).read_bytes())
        known = exif.model and (exif.focal_mm or exif.focal_35mm)
        facts = photo_facts(path) if known else None
    except (OSError, PhotoError):
        return None
    if facts is None:
        return None
    focal = exif.focal_mm or 0.0, exif.focal_35mm or 0.0
    return TakenWith(exif.model, exif.lens, *focal, facts.width, facts.height, exif.orientation)
