"""The few EXIF tags that place a photo: orientation, focal length and camera model, from the bytes of JPEG, PNG, WebP, TIFF,
AVIF and HEIC files.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from . import jpeg
from .containers import heif
from .containers.tiff import BYTE_ORDERS, FIRST_DIRECTORY

ORIENTATION, EXIF_IFD, MODEL, LENS_MODEL = 0x0112, 0x8769, 0x0110, 0xA434
ASCII, MODEL_CHARACTERS = 2, 64
FOCAL_LENGTH, FOCAL_35MM = 0x920A, 0xA405
PIXELS_X, PIXELS_Y = 0xA002, 0xA003
PLANE_X_RESOLUTION, PLANE_UNIT = 0xA20E, 0xA210
PLANE_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
NARROWEST_MM, WIDEST_MM = 4.0, 60.0  # the longer side of a sensor, from small phones to medium format
FEWEST_PIXELS = 2_000_000  # a picture of fewer was resized: sensors have had more since about 2000
MAX_ENTRIES, ENTRY_BYTES = 512, 12
READERS = {1: ("B", 1), 3: ("H", 2), 4: ("I", 4), 5: ("II", 8), 9: ("i", 4), 10: ("ii", 8)}  # EXIF type: struct code, size


@dataclass(frozen=True)
class Exif:
    """`orientation` 1..8 as EXIF numbers it; `focal_35mm` the 35 mm equivalent focal length in mm that is stated, None when
    unknown; `focal_mm` the real one, None when unknown; `model` and `lens` the names of camera and lens as the camera writes
    them, empty when unknown; `sensor_35mm` the equivalent that follows from the real one and the sensor that the block tells,
    None where it tells none.
    """

    orientation: int = 1
    focal_35mm: float | None = None
    focal_mm: float | None = None
    model: str = ""
    lens: str = ""
    sensor_35mm: float | None = None


def read_exif(data: bytes) -> Exif:
    """What the file's bytes say; the defaults where it has no EXIF. Of a damaged block it is what can be read, for no photo
    should fail for that.
    """
    block = find_exif(data)
    tags, names = _read_main(block)
    orientation = int(tags.get(ORIENTATION, 1))
    focal = tags.get(FOCAL_LENGTH, 0.0)
    stated = float(tags.get(FOCAL_35MM, 0)) or None
    turn = orientation if 1 <= orientation <= 8 else 1
    said = names.get(MODEL, ""), names.get(LENS_MODEL, "")
    return Exif(turn, stated, focal if focal > 0 else None, *said, _sensor_35mm(tags))


def _read_main(block: bytes) -> tuple[dict[int, float], dict[int, str]]:
    """The numbers and the names in the block's first directory and in its EXIF directory, by their tags."""
    order = BYTE_ORDERS.get(block[:4])
    if order is None or len(block) < FIRST_DIRECTORY.stop:
        return {}, {}
    main = list(_entries(block, order, struct.unpack(order + "I", block[FIRST_DIRECTORY])[0]))
    tags = _numbers(main, order)
    if EXIF_IFD in tags:
        main += _entries(block, order, int(tags[EXIF_IFD]))
        tags = _numbers(main, order)
    return tags, {entry.tag: _text(entry) for entry in main if entry.kind == ASCII and entry.tag in (MODEL, LENS_MODEL)}


def find_exif(data: bytes) -> bytes:
    """The EXIF block, which is a small TIFF file; empty when there is none."""
    if data[:4] in BYTE_ORDERS:
        return data
    if data.startswith(jpeg.SIGNATURE):
        chunks = _jpeg_chunks(data)
    elif data[:8] == b"\x89PNG\r\n\x1a\n":
        chunks = _png_chunks(data)
    elif data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        chunks = _webp_chunks(data)
    elif heif.is_avif(data) or heif.is_heic(data):
        return heif.read_facts(data).exif
    else:
        return b""
    return next((block.removeprefix(b"Exif\0\0") for block in chunks), b"")


def _jpeg_chunks(data: bytes) -> Iterator[bytes]:
    for segment in jpeg.header_segments(data):
        if segment.marker == jpeg.APP1 and data.startswith(b"Exif\0\0", segment.start):
            yield data[segment.start : segment.end]


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


@dataclass(frozen=True)
class _Entry:
    """One entry of a directory: `raw` holds its first value, or its text; shorter than that where the block is cut off."""

    tag: int
    kind: int
    raw: bytes


def _entries(block: bytes, order: str, offset: int) -> Iterator[_Entry]:
    """The entries of the directory at `offset`, as far as the block goes."""
    start = offset + 2
    if offset < 0 or start > len(block):
        return
    (count,) = struct.unpack(order + "H", block[offset:start])
    for at in range(start, start + ENTRY_BYTES * min(count, MAX_ENTRIES), ENTRY_BYTES):
        entry = block[at : at + ENTRY_BYTES]
        if len(entry) < ENTRY_BYTES:
            return
        tag, kind, length, place = struct.unpack(order + "HHII", entry)
        size = min(length, MODEL_CHARACTERS) if kind == ASCII else READERS[kind][1] if kind in READERS else 0
        whole = length if kind == ASCII else size
        yield _Entry(tag, kind, entry[8 : 8 + size] if whole <= 4 else block[place : place + size])


def _numbers(entries: Iterable[_Entry], order: str) -> dict[int, float]:
    """Tag to its first value, of the entries that are whole numbers or fractions."""
    tags: dict[int, float] = {}
    for entry in entries:
        code, size = READERS.get(entry.kind, ("", 0))
        if size and len(entry.raw) == size:
            values = struct.unpack(order + code, entry.raw)
            tags[entry.tag] = values[0] if len(values) == 1 else values[0] / values[1] if values[1] else 0.0
    return tags


def _text(entry: _Entry) -> str:
    return entry.raw.split(b"\0")[0].decode("latin-1").strip()


def _sensor_35mm(tags: dict[int, float]) -> float | None:
    """The equivalent by the real focal length and the sensor's pixel pitch; None where that makes no sensor of a camera, as in
    photos that were resized without their resolution.
    """
    needed = (FOCAL_LENGTH, PLANE_X_RESOLUTION, PIXELS_X, PIXELS_Y)
    if any(tags.get(tag, 0) <= 0 for tag in needed):
        return None
    pitch = PLANE_UNIT_MM.get(int(tags.get(PLANE_UNIT, 2)), 25.4) / tags[PLANE_X_RESOLUTION]
    possible = NARROWEST_MM <= pitch * max(tags[PIXELS_X], tags[PIXELS_Y]) <= WIDEST_MM
    if not possible or tags[PIXELS_X] * tags[PIXELS_Y] < FEWEST_PIXELS:
        return None
    return tags[FOCAL_LENGTH] * FULL_FRAME_DIAGONAL_MM / (pitch * math.hypot(tags[PIXELS_X], tags[PIXELS_Y]))
