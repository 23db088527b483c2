"""Masks inside Blender: the picture that leaves people, sky and cars of a camera's photo out of matching."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...core.errors import CameraError, PhotoError
from ...core.photos.mask import WHITE, with_mask
from ...core.photos.photo import Photo
from ..support.texts import rpt_
from . import image as photo_image
from .source import PhotoSource

SINGLE: tuple[str, ...] = ("FILE", "GENERATED")  # The sources that stand for a single picture.


@dataclass(frozen=True)
class MaskedSource:
    """A photo with its mask; itself a PhotoSource. A mask that Blender alone has pixels of is read already."""

    photo: PhotoSource
    mask: PhotoSource | Photo

    @property
    def name(self) -> str:
        return self.photo.name

    @property
    def path(self) -> str:
        return self.photo.path

    def read(self) -> Photo:
        """Decodes photo and mask; needs no Blender. Raises PhotoError, also when the two do not go together."""
        photo = self.photo.read()
        return with_mask(photo, self.mask if isinstance(self.mask, Photo) else self.mask.read())


def masked(photo: PhotoSource, mask: PhotoSource | Photo | None) -> PhotoSource:
    """`photo` with what `of` gave for its camera."""
    return photo if mask is None else MaskedSource(photo, mask)


def of(camera: bpy.types.Object) -> PhotoSource | Photo | None:
    """The camera's mask, copied out of Blender; None when it has none. Raises PhotoError when its image has no pixels."""
    image = camera.data.gssmc.mask
    return source(image) if image else None


def source(image: bpy.types.Image) -> PhotoSource | Photo:
    """Where the engine finds a mask: its file; or its pixels, where it was painted in Blender or is OpenEXR.

    Raises PhotoError when it is no picture.
    """
    if image.source not in SINGLE:
        raise PhotoError(rpt_('The mask "{name}" is no single picture; pick one that is.', name=image.name))
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "GENERATED" or image.is_dirty or photo_image.is_exr(image, path):
        return _painted(image)
    return photo_image.photo_source(image)


def _painted(image: bpy.types.Image) -> Photo:
    (width, height), channels = image.size, image.channels
    if not width or not height or len(image.pixels) != channels * width * height:
        raise PhotoError(rpt_('The mask "{name}" has no pixels that Blender can read; save it as PNG.', name=image.name))
    values = np.empty(channels * width * height, np.float32)
    image.pixels.foreach_get(values)
    colours = values.reshape(height, width, channels)[::-1, :, : min(channels, 3)]  # Blender stores the bottom row first.
    white = (colours.max(axis=2) >= WHITE / 255).astype(np.uint8) * np.uint8(255)
    return Photo(np.repeat(white[..., None], 3, axis=2), image.name)


def load(path: str) -> bpy.types.Image:
    """The mask as a Blender image. Raises CameraError when there is no such file."""
    try:
        return bpy.data.images.load(bpy.path.abspath(path), check_existing=True)
    except RuntimeError:
        raise CameraError(rpt_("There is no mask at '{path}'; check the path.", path=path)) from None
