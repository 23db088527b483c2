"""How many pixels a photo has, from its first bytes: before a decoder allocates room for them."""

from __future__ import annotations

from ..errors import PhotoError
from . import jpeg
from .containers import heif, tiff

EXR_SIGNATURE = b"\x76\x2f\x31\x01"
# A larger photo is reduced, because the method works at a long side of some hundred pixels.
MAX_PIXELS = 32 << 20
# A photo with more pixels is refused.
LARGEST_PIXELS = 400_000_000
# So is one whose long side is more times its short one; the widest panoramas have about 30.
LARGEST_ASPECT = 100
FACTORS = (2, 4, 8)


def check_photo_size(size: tuple[int, int], name: str) -> None:
    """Raises PhotoError when no photo has so many pixels (width, height), or such a shape."""
    problem = size_problem(*size)
    if problem:
        raise PhotoError(f"The photo '{name}' says that it has {size[0]} x {size[1]} pixels; {problem}, so save another copy.")


def size_problem(width: int, height: int) -> str:
    """What keeps a picture of that size, both sides above 0, from being a photo, as the end of a sentence; "" when nothing."""
    if width * height > LARGEST_PIXELS:
        return f"at most {LARGEST_PIXELS // 1_000_000} megapixels can be read"
    if max(width, height) > LARGEST_ASPECT * min(width, height):
        return f"the long side may be at most {LARGEST_ASPECT} times the short one"
    return ""


def reduction(size: tuple[int, int]) -> int:
    """1, or the smallest of FACTORS that brings a photo of that size below MAX_PIXELS."""
    pixels = size[0] * size[1]
    return next((f for f in (1, *FACTORS) if pixels <= MAX_PIXELS * f * f), FACTORS[-1])


def picture_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) as stored in a JPEG, PNG, TIFF, WebP, AVIF or HEIC file; None where it can't be told."""
    if data[:8] == b"\x89PNG\r\n\x1a\n" and len(data) >= 24:
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data.startswith(jpeg.SIGNATURE):
        return jpeg.size(data)
    if data[:4] == b"RIFF" and data[8:16] == b"WEBPVP8X" and len(data) >= 30:
        return 1 + int.from_bytes(data[24:27], "little"), 1 + int.from_bytes(data[27:30], "little")
    if heif.is_avif(data) or heif.is_heic(data):
        return heif.read_facts(data).size
    found = tiff.find_picture(data, "")
    return found.size if found else None
