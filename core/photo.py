"""The photograph as the engine takes it: upright 8-bit RGB pixels, and what EXIF says of the lens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Intrinsics
from .errors import PhotoError
from .exif import read_exif

TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
ROTATION_WORDS = {
    2: "mirrored left to right",
    3: "rotated by 180 degrees",
    4: "mirrored top to bottom",
    5: "mirrored and rotated by 90 degrees",
    6: "rotated by 90 degrees clockwise",
    7: "mirrored and rotated by 90 degrees",
    8: "rotated by 90 degrees counter-clockwise",
}


@dataclass(frozen=True)
class Photo:
    """`pixels` (H, W, 3) uint8 RGB, upright (EXIF rotation applied), still lens-distorted.

    `focal_35mm`: 35 mm equivalent focal length from EXIF in mm, None when absent.
    `mask`: (H, W) bool, True where the photo has content (alpha > 0); None when every pixel has.
    `notes`: sentences about what was done to the pixels on reading (16-bit scaled, alpha dropped, rotated).
    """

    pixels: NDArray[np.uint8]
    file: str = ""
    focal_35mm: float | None = None
    mask: NDArray[np.bool_] | None = None
    notes: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])


def read_photo(path: str | Path) -> Photo:
    """The photo in a JPEG, PNG, TIFF or WebP file: 8 or 16 bit, grey or colour, with or without alpha.

    Raises PhotoError when the file is missing, cut off, or no picture that can be decoded.
    """
    path = Path(path)
    data = _read_bytes(path)
    raw = _decode(data, path)
    exif = read_exif(data)
    notes: list[str] = []
    if raw.dtype == np.uint16:
        raw = ((raw.astype(np.uint32) + 128) // 257).astype(np.uint8)
        notes.append("The photo has 16 bits per channel; it is used with 8.")
    if raw.dtype != np.uint8:
        raise PhotoError(f"The photo '{path.name}' holds {raw.dtype} values; save it with 8 or 16 bits per channel.")
    if exif.orientation != 1:
        notes.append(f"The photo is {ROTATION_WORDS[exif.orientation]}, as its EXIF data say.")
        if not data.startswith(TIFF_SIGNATURES):  # OpenCV 5 turns a TIFF even when told to leave the pixels alone
            raw = _turn(raw, exif.orientation)
    pixels, mask = _split_alpha(raw, notes)
    return Photo(np.ascontiguousarray(pixels), str(path), exif.focal_35mm, mask, tuple(notes))


def check_size(photo: Photo, intrinsics: Intrinsics) -> Intrinsics:
    """The camera at the photo's size: itself, or resized where the photo has the same shape within a rounding pixel.

    Raises PhotoError when the shapes contradict each other.
    """
    pw, ph, cw, ch = photo.width, photo.height, intrinsics.width, intrinsics.height
    if (pw, ph) == (cw, ch):
        return intrinsics
    slack = max(1.0, pw / cw, ph / ch)  # one pixel of the larger image's grid
    if max((pw - slack) / cw, (ph - slack) / ch) <= min((pw + slack) / cw, (ph + slack) / ch):
        return intrinsics.resized(pw, ph)
    turned = " turned by 90 degrees" if (pw - ph) * (cw - ch) < 0 else ""
    name = Path(photo.file).name or "the photo"
    raise PhotoError(
        f"'{name}' has {pw} x {ph} pixels but its camera {cw} x {ch}, which is another shape{turned}; "
        "use the photo that the camera describes, uncropped."
    )


def _read_bytes(path: Path) -> bytes:
    if path.is_dir():
        raise PhotoError(f"'{path}' is a folder; choose a photo inside it.")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise PhotoError(f"There is no photo at '{path}'; check the path.") from None
    except OSError as error:
        raise PhotoError(f"The photo '{path}' cannot be read ({error.strerror}); check its permissions.") from error
    if not data:
        raise PhotoError(f"The photo '{path}' is empty (0 bytes); copy it again.")
    if data[:2] == b"\xff\xd8" and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise PhotoError(f"The photo '{path.name}' is cut off: the JPEG has no end; copy it again.")  # decoders fill with grey
    return data


def _decode(data: bytes, path: Path) -> NDArray[Any]:
    """(H, W) or (H, W, C), channels in OpenCV's order, bits as in the file. Never hands out None (it would crash OpenCV)."""
    try:
        raw = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):  # too many pixels, or a header that asserts
        raw = None
    if raw is None or raw.size == 0:
        raise PhotoError(f"The photo '{path.name}' cannot be decoded; save it as JPEG, PNG, TIFF or WebP.")
    return np.asarray(raw)


def _turn(raw: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Pixels as stored to upright pixels, for an EXIF orientation of 1..8."""
    if orientation >= 5:
        raw = raw.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        raw = raw[:, ::-1]
    if orientation in (3, 4, 7, 8):
        raw = raw[::-1]
    return raw


def _split_alpha(raw: NDArray[np.uint8], notes: list[str]) -> tuple[NDArray[np.uint8], NDArray[np.bool_] | None]:
    """RGB pixels, and the mask of what is not transparent (None when everything shows)."""
    if raw.ndim == 2:
        raw = raw[..., None]
    channels = raw.shape[2]
    mask = None
    if channels in (2, 4):
        mask = np.ascontiguousarray(raw[..., -1] > 0)
        notes.append(
            "The photo has an alpha channel; transparent pixels are left out."
            if not mask.all()
            else "The photo has an alpha channel that hides nothing; it is dropped."
        )
        if not mask.any():
            raise PhotoError("The photo is fully transparent; save it without its alpha channel.")
        mask = None if mask.all() else mask
    if channels <= 2:
        notes.append("The photo is grey.")
        return np.repeat(raw[..., :1], 3, axis=2), mask
    return raw[..., 2::-1], mask
