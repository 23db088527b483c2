"""Which of the pictures in a file is the photo, for each kind of container."""

from __future__ import annotations

from ..exif import Exif
from ..size import picture_size
from . import heif, raw, tiff
from .encoded import EncodedPicture


def find_picture(data: bytes, exif: Exif, name: str) -> EncodedPicture:
    """The photo in the bytes of a file of any kind. Raises PhotoError where it holds no photo of its full size."""
    if tiff.is_tiff(data):
        found = tiff.find_picture(data, name)
        if found is not None:
            return found
    kind = raw.kind_of(data)
    if kind:
        return raw.find_picture(data, name, kind)
    if heif.is_avif(data) or heif.is_heic(data):
        facts = heif.read_facts(data)
        return EncodedPicture((data,), facts.size, facts.orientation)
    return EncodedPicture((data,), picture_size(data), exif.orientation)
