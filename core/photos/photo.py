"""The photograph as the engine takes it: upright 8-bit RGB pixels, and what EXIF says of the lens."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import PhotoError
from ..geometry.camera import Intrinsics
from . import jpeg
from .containers.exr_header import pixel_aspect
from .containers.find import find_picture
from .containers.light import expose
from .containers.openexr import read_light
from .decode import decode
from .exif import Exif, read_exif
from .sensors import focal_35mm_of
from .size import EXR_SIGNATURE

ROTATION_WORDS = {
    2: "mirrored left to right",
    3: "rotated by 180 degrees",
    4: "mirrored top to bottom",
    5: "mirrored and rotated by 90 degrees",
    6: "rotated by 90 degrees clockwise",
    7: "mirrored and rotated by 90 degrees",
    8: "rotated by 90 degrees counter-clockwise",
}


@dataclass(frozen=True, eq=False)
class Photo:
    """`pixels` (H, W, 3) uint8 RGB, upright (EXIF rotation applied), still lens-distorted.

    `focal_35mm`: 35 mm equivalent focal length in mm from EXIF, or from its real one and the sensor's size; None when unknown.
    `mask`: (H, W) bool, True where the photo has content (alpha > 0); None when every pixel has.
    `notes`: sentences about what was done to the pixels on reading (16-bit scaled, alpha dropped, rotated).
    `full_size`: (width, height) of a very large photo whose `pixels` were reduced on reading; None when they are all there.
    `orientation`: 1..8 as EXIF numbers how the file's pixels lie; other than 1 where its own file shows the photo turned.
    `pixel_aspect`: how wide a pixel is shown, in its heights, where the file says so (a squeezed plate).
    `width` and `height` are the photo's own, which its camera belongs to; `pixels` may be fewer.
    """

    pixels: NDArray[np.uint8]
    file: str = ""
    focal_35mm: float | None = None
    mask: NDArray[np.bool_] | None = None
    notes: tuple[str, ...] = ()
    full_size: tuple[int, int] | None = None
    orientation: int = 1
    pixel_aspect: float = 1.0

    @property
    def stored_upright(self) -> bool:
        return self.orientation == 1

    @property
    def width(self) -> int:
        return self.full_size[0] if self.full_size else int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        return self.full_size[1] if self.full_size else int(self.pixels.shape[0])


def read_photo(path: str | Path) -> Photo:
    """The photo in a JPEG, PNG, TIFF or WebP file: 8 or 16 bit, grey or colour, with or without alpha; or in an OpenEXR file of
    scan lines, whose light is exposed (`containers/light.py`).

    More than MAX_PIXELS are reduced by 2, 4 or 8 while they are read. Raises PhotoError when the file is missing, cut off, no
    picture that can be decoded, or too large to be one.
    """
    path = Path(path)
    data = _read_bytes(path)
    return _decoded(path, data, read_exif(data))


def _decoded(path: Path, data: bytes, exif: Exif) -> Photo:
    if data.startswith(EXR_SIGNATURE):
        shown = expose(read_light(data, path.name), pixel_aspect(data))
        return Photo(shown.pixels, str(path), None, shown.mask, shown.notes, shown.full_size, pixel_aspect=shown.pixel_aspect)
    picture = find_picture(data, exif, path.name)
    decoded = decode(picture, path.name)
    raw, notes = decoded.raw, []
    if raw.dtype == np.uint16:
        raw = ((raw.astype(np.uint32) + 128) // 257).astype(np.uint8)
        notes.append("The photo has 16 bits per channel; it is used with 8.")
    if raw.dtype != np.uint8:
        raise PhotoError(f"The photo '{path.name}' holds {raw.dtype} values; save it with 8 or 16 bits per channel.")
    if picture.raw_kind:
        notes.append("The raw photo is developed with its camera's white balance.")
    if picture.orientation != 1:
        notes.append(f"The photo is {ROTATION_WORDS[picture.orientation]}, as its EXIF data say.")
    factor, full = decoded.factor, decoded.full_size
    if factor > 1:
        notes.append(f"The photo has {full[0]} x {full[1]} pixels; every {factor} x {factor} of them are used as one.")
    pixels, mask = _split_alpha(raw, notes)
    photo = Photo(np.ascontiguousarray(pixels), str(path), None, mask, tuple(notes), full if factor > 1 else None)
    return _with_focal(replace(photo, orientation=picture.orientation), exif)


@dataclass(frozen=True)
class PhotoFacts:
    """What a photo's header says: size upright, `focal_35mm` and `orientation` as in Photo."""

    width: int
    height: int
    focal_35mm: float | None
    orientation: int = 1

    @property
    def stored_upright(self) -> bool:
        return self.orientation == 1


def photo_facts(path: str | Path) -> PhotoFacts:
    """The facts as `read_photo` would find them, without decoding where the header tells the size. Raises PhotoError."""
    path = Path(path)
    data = _read_bytes(path)
    exif = read_exif(data)
    picture = None if data.startswith(EXR_SIGNATURE) else find_picture(data, exif, path.name)
    if picture is None or picture.size is None:
        photo = _decoded(path, data, exif)
        return PhotoFacts(photo.width, photo.height, photo.focal_35mm, photo.orientation)
    width, height = picture.size[::-1] if picture.orientation >= 5 else picture.size
    return PhotoFacts(width, height, _focal_35mm(exif, width, height), picture.orientation)


def _focal_35mm(exif: Exif, width: int, height: int) -> float | None:
    """The 35 mm equivalent (mm) that EXIF states, or that follows from the real focal length and the sensor: the one of
    the table first, because EXIF's own belongs to the photo before it was resized.
    """
    if exif.focal_35mm is not None or exif.focal_mm is None:
        return exif.focal_35mm
    return focal_35mm_of(exif.model, exif.focal_mm, width, height) or exif.sensor_35mm


def _with_focal(photo: Photo, exif: Exif) -> Photo:
    """`photo` with its focal length, and a note where that was read with the camera's sensor."""
    focal = _focal_35mm(exif, photo.width, photo.height)
    if focal is None or exif.focal_35mm is not None:
        return replace(photo, focal_35mm=focal)
    note = f"Its focal length of {exif.focal_mm:.4g} mm is read with the sensor of the camera '{exif.model}'."
    return replace(photo, focal_35mm=focal, notes=(*photo.notes, note))


def check_size(photo: Photo, intrinsics: Intrinsics) -> Intrinsics:
    """The camera at the photo's size: itself, or resized where the photo has the same shape within a rounding pixel.

    Raises PhotoError when the shapes contradict each other.
    """
    pw, ph, cw, ch = photo.width, photo.height, intrinsics.width, intrinsics.height
    if (pw, ph) == (cw, ch):
        return intrinsics
    if same_shape((pw, ph), (cw, ch)):
        return intrinsics.resized(pw, ph)
    turned = " turned by 90 degrees" if (pw - ph) * (cw - ch) < 0 else ""
    name = Path(photo.file).name or "the photo"
    raise PhotoError(
        f"'{name}' has {pw} x {ph} pixels but its camera {cw} x {ch}, which is another shape{turned}; "
        "use the photo that the camera describes, uncropped."
    )


def same_shape(photo: tuple[int, int], camera: tuple[int, int]) -> bool:
    """Whether two sizes are of one picture at two scales, up to a pixel of the larger one's grid that rounding may take."""
    (pw, ph), (cw, ch) = photo, camera
    slack = max(1.0, pw / cw, ph / ch)
    return max((pw - slack) / cw, (ph - slack) / ch) <= min((pw + slack) / cw, (ph + slack) / ch)


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
    # Decoders fill what is missing with grey.
    if data.startswith(jpeg.SIGNATURE) and not jpeg.is_whole(data):
        raise PhotoError(f"The photo '{path.name}' is cut off: the JPEG has no end; copy it again.")
    return data


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
