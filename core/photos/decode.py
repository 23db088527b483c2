"""A photo's encoded pixels to upright ones: by OpenCV; HEIC, JPEG XL and raw photos by packages that may be installed."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import PhotoError
from ..support.quiet import quiet_opencv
from . import jpeg
from .containers import heif, png
from .containers import raw as developed
from .containers.encoded import EncodedPicture
from .size import EXR_SIGNATURE, check_photo_size, reduction

HEIF_PACKAGE = "pi_heif"  # a wheel of its own, which the extension does not bring
REDUCED_JPEG = {2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4, 8: cv2.IMREAD_REDUCED_COLOR_8}
JXL_SIGNATURES = ((0, b"\xff\x0a"), (4, b"JXL \r\n\x87\n"))
JXL_PACKAGE = "pillow_jxl"  # adds JPEG XL to Pillow
COLOURS = 3
# What a file is that nothing here decodes: where its signature stands, the signature, and the words.
OTHERS = (
    (0, b"8BPS", "a Photoshop document"),
    (0, b"%PDF", "a PDF document"),
)


@dataclass(frozen=True, eq=False)
class DecodedPicture:
    """`raw` (H, W) or (H, W, C), upright, channels in OpenCV's order, bits as in the file; `factor`: factor x factor pixels
    were made one; `full_size` (width, height) upright before that.
    """

    raw: NDArray[Any]
    factor: int
    full_size: tuple[int, int]


def decode(picture: EncodedPicture, name: str) -> DecodedPicture:
    """The pixels of a picture of the file `name`. Raises PhotoError when it cannot be decoded, or is too large for a photo."""
    if picture.size:
        check_photo_size(picture.size, name)
    factor = 1
    if picture.raw_kind:
        raw, factor = developed.develop(picture, name)
    elif _is_jxl(picture.parts[0]):
        raw, picture = _jxl(picture.parts[0], name), replace(picture, turned_by_decoder=True)
    elif heif.is_heic(picture.parts[0]):
        raw, picture = _heic(picture.parts[0], name), replace(picture, turned_by_decoder=True)
    else:
        raw = _joined([_decoded(part, picture, name) for part in picture.parts], name)
    size = picture.size or (raw.shape[1], raw.shape[0])
    check_photo_size(size, name)
    factor = max(factor, reduction(size))
    across = size[0] if picture.orientation < 5 or not picture.turned_by_decoder else size[1]
    if factor > 1 and raw.shape[1] >= across:
        # The decoder has not left pixels out.
        raw = cv2.resize(raw, (raw.shape[1] // factor, raw.shape[0] // factor), interpolation=cv2.INTER_AREA)
    if not picture.turned_by_decoder:
        raw = _turn(raw, picture.orientation)
    turned = picture.size is not None and picture.orientation >= 5
    return DecodedPicture(raw, factor, size[::-1] if turned else size)


def _decoded(part: bytes, picture: EncodedPicture, name: str) -> NDArray[Any]:
    """One part's pixels. Never hands out None (it would crash OpenCV)."""
    if part.startswith(EXR_SIGNATURE):
        raise PhotoError(
            f"'{name}' is an OpenEXR picture, which only Add Photo in Blender reads; save it as PNG, TIFF or JPEG."
        )
    if part.startswith(png.SIGNATURE) and (problem := png.problem(part)):
        raise PhotoError(f"The photo '{name}' {problem}; copy it again.")
    factor = reduction(picture.size) if picture.size else 1
    flags = cv2.IMREAD_UNCHANGED
    # The decoder leaves pixels out, so that they take no memory.
    if factor > 1 and part.startswith(jpeg.SIGNATURE):
        flags = REDUCED_JPEG[factor] | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        with quiet_opencv():
            raw = cv2.imdecode(np.frombuffer(part, np.uint8), flags)
    # The image has too many pixels, or its header makes the decoder raise.
    except (cv2.error, MemoryError):
        raw = None
    if raw is None or raw.size == 0:
        raise _undecodable(part, name)
    return np.asarray(raw)


def _joined(parts: list[NDArray[Any]], name: str) -> NDArray[Any]:
    """The picture of its planes, which stand in the order red, green, blue, alpha; a picture in one part as it is."""
    if len(parts) == 1:
        return parts[0]
    if len({(part.shape, part.dtype) for part in parts}) > 1 or parts[0].ndim != 2:
        raise _undecodable(b"", name)
    return np.stack([*parts[COLOURS - 1 :: -1], *parts[COLOURS:]] if len(parts) >= COLOURS else parts, axis=2)


def _heic(data: bytes, name: str) -> NDArray[Any]:
    """The pixels of a HEIC file, which libheif turns as its boxes say."""
    try:
        package = import_module(HEIF_PACKAGE)
    except ImportError:
        raise PhotoError(
            f"'{name}' is a HEIC photo, which needs the Python package pi-heif; install it into this Python, or save the photo "
            "as JPEG."
        ) from None
    try:
        return np.asarray(package.open_heif(io.BytesIO(data), bgr_mode=True))
    except (ValueError, EOFError, SyntaxError, RuntimeError, OSError, MemoryError):
        raise _undecodable(data, name) from None


def _is_jxl(data: bytes) -> bool:
    return any(data.startswith(signature, at) for at, signature in JXL_SIGNATURES)


def _jxl(data: bytes, name: str) -> NDArray[Any]:
    """The pixels of a JPEG XL file, which its decoder turns as its header says."""
    try:
        import_module(JXL_PACKAGE)
        images = import_module("PIL.Image")
    except ImportError:
        raise PhotoError(
            f"'{name}' is a JPEG XL picture, which needs the Python package pillow-jxl-plugin; install it into this Python, or "
            "save the photo as JPEG, PNG or TIFF."
        ) from None
    try:
        with images.open(io.BytesIO(data)) as image:
            check_photo_size(image.size, name)
            pixels = np.asarray(image)
    except (ValueError, EOFError, SyntaxError, RuntimeError, OSError, MemoryError):
        raise _undecodable(data, name) from None
    if pixels.ndim == COLOURS and pixels.shape[2] >= COLOURS:
        return pixels[..., [2, 1, 0, *range(COLOURS, pixels.shape[2])]]
    return pixels


def _undecodable(data: bytes, name: str) -> PhotoError:
    kind = next((words for at, signature, words in OTHERS if data.startswith(signature, at)), None)
    if kind is None:
        return PhotoError(f"The photo '{name}' cannot be decoded; save it as JPEG, PNG, TIFF or WebP.")
    return PhotoError(f"'{name}' is {kind}, which cannot be read here; save the photo as JPEG, PNG or TIFF.")


def _turn(raw: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Pixels as stored to upright pixels, for an EXIF orientation of 1..8."""
    if orientation >= 5:
        raw = raw.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        raw = raw[:, ::-1]
    if orientation in (3, 4, 7, 8):
        raw = raw[::-1]
    return raw
