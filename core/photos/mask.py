"""Masks of photos: people, sky and cars that the scan does not have, left out of matching. White is used, black is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ..errors import PhotoError
from ..support.picture_names import SUFFIXES, spelt, stem_of
from .photo import Photo, read_photo

# From this level (of 255) on, a pixel of the mask counts as white.
WHITE = 128


def find_mask(masks: Path, photo: Path) -> Path | None:
    """The mask of `photo`: `masks` itself, or in that folder the file of the photo's name, with .png behind it or another
    picture suffix in place of its own, never the photo itself. None when the folder has none.

    Raises PhotoError when `masks` does not exist.
    """
    if masks.is_file():
        return masks
    if not masks.is_dir():
        raise PhotoError(f"There is no mask or folder of masks at '{masks}'; check the path.")
    stem = stem_of(photo.name)
    names = [photo.name + ".png", photo.name, f"{stem}.png", *(stem + suffix for suffix in SUFFIXES)]
    exact = [masks / name for name in names]
    there = {spelt(file.name): file for file in sorted(masks.iterdir(), reverse=True)}
    alike = [there[spelt(name)] for name in names if spelt(name) in there]
    found = (file for file in (*exact, *alike) if file.is_file())
    return next((file for file in found if not photo.exists() or not file.samefile(photo)), None)


def masked(photo: Photo, mask: Path) -> Photo:
    """`photo` without what is black in the picture `mask`, which must have the photo's size, upright as the photo is.

    Raises PhotoError when the mask can't be read, has another size or leaves nothing.
    """
    return with_mask(photo, read_photo(mask))


def with_mask(photo: Photo, picture: Photo) -> Photo:
    """`masked` for a mask that is read already. Raises PhotoError when it has another size or leaves nothing."""
    name = Path(picture.file).name
    if (picture.width, picture.height) != (photo.width, photo.height):
        raise PhotoError(
            f"The mask '{name}' has {picture.width} x {picture.height} pixels but its photo "
            f"{photo.width} x {photo.height}; make it for the photo as it is seen upright."
        )
    white = picture.pixels.max(axis=2) >= WHITE
    size = photo.pixels.shape[1], photo.pixels.shape[0]
    if white.shape != photo.pixels.shape[:2]:
        white = cv2.resize(white.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    use = white if photo.mask is None else white & photo.mask
    if not use.any():
        raise PhotoError(f"The mask '{name}' leaves nothing of the photo; white is what is used, black what is left out.")
    share = 100 * (1 - float(use.mean()))
    return replace(photo, mask=use, notes=(*photo.notes, f"The mask '{name}' leaves out {share:.0f} % of the photo."))
