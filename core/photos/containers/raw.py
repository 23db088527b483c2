"""Raw photos, developed by LibRaw where the rawpy package is installed: with the camera's white balance, as 8-bit sRGB.

Half of the pixels across and down suffice where a photo has many: no colour is guessed then, because a cell of the sensor's
colour filters has all three, and it takes a quarter of the time.
"""

from __future__ import annotations

import io
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import PhotoError
from .encoded import EncodedPicture

PACKAGE = "rawpy"  # a wheel of its own, which the extension does not bring
# Where the signature of a kind stands, the signature, and the words; raw photos that are TIFF files show in their directories.
KINDS = (
    (4, b"ftypcrx ", "a Canon raw photo (CR3)"),
    (0, b"FUJIFILMCCD-RAW", "a Fujifilm raw photo (RAF)"),
    (0, b"IIRO", "an Olympus raw photo (ORF)"),
    (0, b"IIRS", "an Olympus raw photo (ORF)"),
    (0, b"IIU\0", "a Panasonic raw photo (RW2)"),
    (0, b"FOVb", "a Sigma raw photo (X3F)"),
)
# LibRaw's flip (0, 3, and 5, 6 for quarter turns left and right) as EXIF numbers it.
ORIENTATIONS = {0: 1, 3: 3, 5: 8, 6: 6}
# From so many pixels on, half of them across and down are used.
MANY_PIXELS = 8 << 20
HALF = 2


def kind_of(data: bytes) -> str:
    """What kind of a raw photo the bytes are, in words; empty for anything else."""
    return next((words for at, signature, words in KINDS if data.startswith(signature, at)), "")


def find_picture(data: bytes, name: str, kind: str) -> EncodedPicture:
    """The raw photo in the bytes of the file `name`; `kind` says what it is. Raises PhotoError where rawpy is not installed, or
    LibRaw does not know it.
    """
    package = _package(name, kind)
    try:
        with package.imread(io.BytesIO(data)) as opened:
            sizes = opened.sizes
            turn = ORIENTATIONS.get(sizes.flip, 1)
            return EncodedPicture((data,), (int(sizes.iwidth), int(sizes.iheight)), turn, raw_kind=kind)
    except _faults(package):
        raise _undeveloped(name, kind) from None


def develop(picture: EncodedPicture, name: str) -> tuple[NDArray[Any], int]:
    """The pixels (H, W, 3) as stored, channels in OpenCV's order, and how many across and down were made one."""
    package = _package(name, picture.raw_kind)
    half = picture.pixels > MANY_PIXELS
    try:
        with package.imread(io.BytesIO(picture.parts[0])) as opened:
            pixels = opened.postprocess(use_camera_wb=True, half_size=half, output_bps=8, user_flip=0)
    except _faults(package):
        raise _undeveloped(name, picture.raw_kind) from None
    return np.asarray(pixels)[..., ::-1], HALF if half else 1


def _package(name: str, kind: str) -> Any:
    try:
        return import_module(PACKAGE)
    except ImportError:
        raise PhotoError(
            f"'{name}' is {kind}, which needs the Python package {PACKAGE}; install it into this Python, or develop the photo "
            "to JPEG or TIFF."
        ) from None


def _faults(package: Any) -> tuple[type[Exception], ...]:
    return (package.LibRawError, ValueError, RuntimeError, OSError, MemoryError)


def _undeveloped(name: str, kind: str) -> PhotoError:
    return PhotoError(f"'{name}' is {kind}, which LibRaw cannot read here; develop the photo to JPEG or TIFF.")
