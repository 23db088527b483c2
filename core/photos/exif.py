"""The few EXIF tags that place a photo: orientation, focal length and camera model, from JPEG, PNG, WebP and TIFF bytes."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

ORIENTATION, EXIF_IFD, MODEL = 0x0112, 0x8769, 0x0110
TIFF_WIDTH, TIFF_HEIGHT = 0x0100, 0x0101
ASCII, MODEL_CHARACTERS = 2, 64
FOCAL_LENGTH, FOCAL_35MM = 0x920A, 0xA405
PIXELS_X, PIXELS_Y = 0xA002, 0xA003
PLANE_X_RESOLUTION, PLANE_UNIT = 0xA20E, 0xA210
PLANE_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
MAX_ENTRIES = 512
READERS = {1: ("B", 1), 3: ("H", 2), 4: ("I", 4), 5: ("II", 8), 9: ("i", 4), 10: ("ii", 8)}  # EXIF type: struct code, size


@dataclass(frozen=True)
class Exif:
    """`orientation` 1..8 as EXIF numbers it; `focal_35mm` the 35 mm equivalent focal length in mm, None when unknown;
    `focal_mm` the real one, None when unknown; `model` the camera's name as it writes it, empty when unknown.
    """

    orientation: int = 1
    focal_35mm: float | None = None
    focal_mm: float | None = None
    model: str = ""


def read_exif(data: bytes) -> Exif:
    """What the file's bytes say; the defaults where it has no EXIF or a damaged one, which no photo should fail for."""
    block = find_exif(data)
    tags: dict[int, float] = {}
    model = ""
    try:
        order = {b"II*\0": "<", b"MM\0*": ">"}[block[:4]]
        first = struct.unpack(order + "I", block[4:8])[0]
        tags.update(_read_directory(block, order, first))
        model = _read_text(block, order, first, MODEL)
        if EXIF_IFD in tags:
            tags.update(_read_directory(block, order, int(tags[EXIF_IFD])))
    except (KeyError, struct.error):
        pass
    orientation = int(tags.get(ORIENTATION, 1))
    focal = tags.get(FOCAL_LENGTH, 0.0)
    return Exif(orientation if 1 <= orientation <= 8 else 1, _focal_35mm(tags), focal if focal > 0 else None, model)


def tiff_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) of a TIFF file's first picture, as stored; None when its first directory does not say."""
    try:
        order = {b"II*\0": "<", b"MM\0*": ">"}[data[:4]]
        tags = _read_directory(data, order, struct.unpack(order + "I", data[4:8])[0])
        return int(tags[TIFF_WIDTH]), int(tags[TIFF_HEIGHT])
    except (KeyError, struct.error):
        return None


def find_exif(data: bytes) -> bytes:
    """The EXIF block, which is a small TIFF file; empty when there is none."""
    if data[:4] in (b"II*\0", b"MM\0*"):
        return data
    if data[:2] == b"\xff\xd8":
        chunks = _jpeg_chunks(data)
    elif data[:8] == b"\x89PNG\r\n\x1a\n":
        chunks = _png_chunks(data)
    elif data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        chunks = _webp_chunks(data)
    else:
        return b""
    return next((block.removeprefix(b"Exif\0\0") for block in chunks), b"")


def _jpeg_chunks(data: bytes) -> Iterator[bytes]:
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        if data[at + 1] == 0xE1 and data[at + 4 : at + 10] == b"Exif\0\0":
            yield data[at + 4 : at + 2 + length]
        at += 2 + max(length, 2)


def _png_chunks(data: bytes) -> Iterator[bytes]:
    at = 8
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        if data[at + 4 : at + 8] == b"eXIf":
            yield data[at + 8 : at + 8 + length]
        at += 12 + length


def _webp_chunks(data: bytes) -> Iterator[bytes]:
    at = 12
    while at + 8 <= len(data):
        length = int.from_bytes(data[at + 4 : at + 8], "little")
        if data[at : at + 4] == b"EXIF":
            yield data[at + 8 : at + 8 + length]
        at += 8 + length + (length & 1)


def _read_directory(block: bytes, order: str, offset: int) -> dict[int, float]:
    """Tag to its first value, of the directory at `offset`; stops where the block ends."""
    tags: dict[int, float] = {}
    (count,) = struct.unpack(order + "H", block[offset : offset + 2])
    for i in range(min(count, MAX_ENTRIES)):
        entry = block[offset + 2 + 12 * i : offset + 14 + 12 * i]
        tag, kind, _ = struct.unpack(order + "HHI", entry[:8])
        if kind not in READERS:
            continue
        code, size = READERS[kind]
        at = struct.unpack(order + "I", entry[8:])[0] if size > 4 else None
        raw = entry[8 : 8 + size] if at is None else block[at : at + size]
        if len(raw) == size:
            values = struct.unpack(order + code, raw)
            tags[tag] = values[0] if len(values) == 1 else values[0] / values[1] if values[1] else 0.0
    return tags


def _read_text(block: bytes, order: str, offset: int, wanted: int) -> str:
    """The text of one tag in the directory at `offset`; empty where there is none."""
    (count,) = struct.unpack(order + "H", block[offset : offset + 2])
    for i in range(min(count, MAX_ENTRIES)):
        entry = block[offset + 2 + 12 * i : offset + 14 + 12 * i]
        tag, kind, length = struct.unpack(order + "HHI", entry[:8])
        if (tag, kind) == (wanted, ASCII):
            at = struct.unpack(order + "I", entry[8:])[0] if length > 4 else None
            raw = entry[8 : 8 + length] if at is None else block[at : at + min(length, MODEL_CHARACTERS)]
            return raw.split(b"\0")[0].decode("latin-1").strip()
    return ""


def _focal_35mm(tags: dict[int, float]) -> float | None:
    """The equivalent as the camera states it, else from the real focal length and the sensor's pixel pitch."""
    if tags.get(FOCAL_35MM, 0) > 0:
        return float(tags[FOCAL_35MM])
    needed = (FOCAL_LENGTH, PLANE_X_RESOLUTION, PIXELS_X, PIXELS_Y)
    if any(tags.get(tag, 0) <= 0 for tag in needed):
        return None
    pitch = PLANE_UNIT_MM.get(int(tags.get(PLANE_UNIT, 2)), 25.4) / tags[PLANE_X_RESOLUTION]
    diagonal = pitch * math.hypot(tags[PIXELS_X], tags[PIXELS_Y])
    return tags[FOCAL_LENGTH] * FULL_FRAME_DIAGONAL_MM / diagonal
