"""The header of an OpenEXR file ("Technical Introduction to OpenEXR", file layout): how wide its pixels are shown."""

from __future__ import annotations

import struct

from ..size import EXR_SIGNATURE

HEADER_BYTES = 1 << 16
VERSION_BYTES, LONGEST_NAME = 8, 255
# A film's squeeze is 2 at most, and old video's pixels are hardly less oblong the other way.
SMALLEST, LARGEST = 0.25, 4.0


def pixel_aspect(data: bytes) -> float:
    """Width over height of a pixel as the file's beginning says; 1 where it says nothing usable."""
    at = VERSION_BYTES if data.startswith(EXR_SIGNATURE) else len(data)
    while at < len(data):
        words = data[at : at + 2 * LONGEST_NAME + 2].split(b"\0", 2)
        if len(words) < 3 or not words[0]:
            break
        name, kind = words[:2]
        at += len(name) + len(kind) + 2
        (length,) = struct.unpack("<I", data[at : at + 4]) if at + 4 <= len(data) else (len(data),)
        value = data[at + 4 : at + 4 + length]
        if name == b"pixelAspectRatio" and kind == b"float" and len(value) == 4:
            (ratio,) = struct.unpack("<f", value)
            return float(ratio) if SMALLEST <= ratio <= LARGEST else 1.0
        at += 4 + length
    return 1.0
