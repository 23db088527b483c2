"""TIFF files (TIFF 6.0, TIFF/EP, DNG): which of their pictures is the photo, and how a decoder gets at it.

A decoder of photos reads the first directory only, where many programs put a thumbnail. Here all directories are looked at, and
the file is handed on with its header pointing at the largest picture. Colours that lie in planes of their own are taken apart
into one grey picture each, because OpenCV mixes up their rows.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from .. import jpeg
from . import raw as developed
from .encoded import EncodedPicture

BYTE_ORDERS = {b"II*\0": "<", b"MM\0*": ">"}
FIRST_DIRECTORY = slice(4, 8)  # the bytes that hold its offset
ENTRY_BYTES, MAX_ENTRIES, MAX_DIRECTORIES = 12, 512, 64
WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, ORIENTATION, SAMPLES = 256, 257, 258, 259, 262, 274, 277
STRIP_OFFSETS, STRIP_BYTES, ROWS_PER_STRIP, PLANAR, SUB_DIRECTORIES, JPEG_OFFSET, JPEG_BYTES = 273, 279, 278, 284, 330, 513, 514
PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS, TILE_BYTES, SAMPLE_FORMAT = 317, 322, 323, 324, 325, 339
SHORT, LONG = 3, 4
WHOLE_NUMBERS = {1: ("B", 1), SHORT: ("H", 2), LONG: ("I", 4), 13: ("I", 4)}  # EXIF type: struct code, size
SENSOR_COLOURS = (32803, 34892)  # photometric kinds of a raw photo: colour filter array, linear raw
OLD_JPEG, LOSSLESS_JPEG, GREY, PLANES = 6, 0xC3, 1, 2
MAX_VALUES = 1 << 16  # of one entry
# A preview whose sides are this share of the raw picture's stands for it: cameras crop a few pixels of the sensor.
SHARE_OF_RAW = 0.9


@dataclass(frozen=True)
class _Directory:
    """A directory's whole numbers by tag, and where it lies in the file."""

    at: int
    values: dict[int, tuple[int, ...]]

    def one(self, tag: int, default: int = 0) -> int:
        return next(iter(self.values.get(tag, ())), default)

    @property
    def size(self) -> tuple[int, int]:
        return self.one(WIDTH), self.one(HEIGHT)

    @property
    def pixels(self) -> int:
        return self.one(WIDTH) * self.one(HEIGHT)


def is_tiff(data: bytes) -> bool:
    return data[:4] in BYTE_ORDERS


def find_picture(data: bytes, name: str) -> EncodedPicture | None:
    """The largest picture of a TIFF file; None where no directory tells of one. A raw photo that holds no picture of its full
    size is developed, or PhotoError is raised; `name` is the file's.
    """
    directories = list(_directories(data))
    found = [one for directory in directories if (one := _picture(data, directory)) is not None]
    raw = max((one for one in directories if _is_raw(data, one)), key=lambda one: one.pixels, default=None)
    best = max(found, key=lambda one: one.pixels, default=None)
    if raw is not None and (best is None or best.pixels < SHARE_OF_RAW**2 * raw.pixels):
        preview = "only a small preview" if best else "no picture"
        size = f"{raw.size[0]} x {raw.size[1]} pixels"
        return developed.find_picture(data, name, f"a raw photo of {size} that holds {preview} beside the sensor's values")
    if best is not None and best.orientation == 0:
        # Only the first directory tells it, for all of them.
        first = directories[0].one(ORIENTATION, 1)
        best = EncodedPicture(best.parts, best.size, first if 1 <= first <= 8 else 1)
    return best


def _directories(data: bytes) -> Iterator[_Directory]:
    """The directories of the chain, each followed by those below it; none twice."""
    order = BYTE_ORDERS.get(data[:4])
    if order is None or len(data) < FIRST_DIRECTORY.stop:
        return
    waiting, seen = list(struct.unpack(order + "I", data[FIRST_DIRECTORY])), set[int]()
    while waiting and len(seen) < MAX_DIRECTORIES:
        at = waiting.pop(0)
        if at in seen or not 0 < at <= len(data) - 2:
            continue
        seen.add(at)
        directory = _Directory(at, dict(_entries(data, order, at)))
        after = at + 2 + ENTRY_BYTES * struct.unpack(order + "H", data[at : at + 2])[0]
        following = struct.unpack(order + "I", data[after : after + 4]) if after + 4 <= len(data) else ()
        waiting = [*directory.values.get(SUB_DIRECTORIES, ()), *following, *waiting]
        yield directory


def _entries(data: bytes, order: str, at: int) -> Iterator[tuple[int, tuple[int, ...]]]:
    """(tag, values) of the directory's entries that are whole numbers, as far as the file goes."""
    count = min(struct.unpack(order + "H", data[at : at + 2])[0], MAX_ENTRIES)
    for start in range(at + 2, at + 2 + ENTRY_BYTES * count, ENTRY_BYTES):
        entry = data[start : start + ENTRY_BYTES]
        if len(entry) < ENTRY_BYTES:
            return
        tag, kind, length, place = struct.unpack(order + "HHII", entry)
        code, size = WHOLE_NUMBERS.get(kind, ("", 0))
        if not size or not 0 < length <= MAX_VALUES:
            continue
        raw = entry[8 : 8 + size * length] if size * length <= 4 else data[place : place + size * length]
        if len(raw) == size * length:
            yield tag, struct.unpack(f"{order}{length}{code}", raw)


def _is_raw(data: bytes, directory: _Directory) -> bool:
    inner = _jpeg(data, directory)
    lossless = any(segment.marker == LOSSLESS_JPEG for segment in jpeg.header_segments(inner)) if inner else False
    return bool(directory.pixels) and (directory.one(PHOTOMETRIC, GREY) in SENSOR_COLOURS or lossless)


def _jpeg(data: bytes, directory: _Directory) -> bytes:
    """The JPEG file inside the TIFF that is the directory's picture; empty where it is none."""
    at, size = directory.one(JPEG_OFFSET), directory.one(JPEG_BYTES)
    if not size and directory.one(COMPRESSION) == OLD_JPEG and len(directory.values.get(STRIP_OFFSETS, ())) == 1:
        at, size = directory.one(STRIP_OFFSETS), directory.one(STRIP_BYTES)
    inner = data[at : at + size]
    return inner if inner.startswith(jpeg.SIGNATURE) else b""


def _picture(data: bytes, directory: _Directory) -> EncodedPicture | None:
    if _is_raw(data, directory):
        return None
    orientation = directory.one(ORIENTATION)
    inner = _jpeg(data, directory)
    if inner:
        size = jpeg.size(inner)
        return None if size is None else EncodedPicture((inner,), size, orientation)
    if not directory.pixels:
        return None
    if directory.one(PLANAR, 1) == PLANES and directory.one(SAMPLES, 1) > 1:
        parts = _planes(data, directory)
        return None if not parts else EncodedPicture(parts, directory.size, orientation)
    turned = 1 <= orientation <= 8
    return EncodedPicture((_pointed_at(data, directory.at),), directory.size, orientation, turned)


def _pointed_at(data: bytes, directory: int) -> bytes:
    """The file with its header pointing at that directory."""
    where = struct.pack(BYTE_ORDERS[data[:4]] + "I", directory)
    return data if data[FIRST_DIRECTORY] == where else data[:4] + where + data[8:]


def _planes(data: bytes, directory: _Directory) -> tuple[bytes, ...]:
    """Each plane as a file: the whole file, and behind it a directory of a grey picture; none where places are missing."""
    samples = directory.one(SAMPLES)
    bits = set(directory.values.get(BITS, (1,)))
    places, sizes = (TILE_OFFSETS, TILE_BYTES) if TILE_OFFSETS in directory.values else (STRIP_OFFSETS, STRIP_BYTES)
    offsets, lengths = directory.values.get(places, ()), directory.values.get(sizes, ())
    if len(bits) != 1 or not offsets or len(offsets) % samples or len(offsets) != len(lengths):
        return ()
    each = len(offsets) // samples
    shared = (WIDTH, HEIGHT, COMPRESSION, ROWS_PER_STRIP, PREDICTOR, TILE_WIDTH, TILE_HEIGHT)
    kept = {tag: directory.values[tag][:1] for tag in shared if tag in directory.values}
    kept |= {BITS: (bits.pop(),), PHOTOMETRIC: (GREY,), SAMPLES: (1,)}
    if SAMPLE_FORMAT in directory.values:
        kept[SAMPLE_FORMAT] = directory.values[SAMPLE_FORMAT][:1]
    parts = []
    for plane in range(samples):
        own = slice(plane * each, (plane + 1) * each)
        parts.append(_with_directory(data, {**kept, places: offsets[own], sizes: lengths[own]}))
    return tuple(parts)


def _with_directory(data: bytes, values: dict[int, tuple[int, ...]]) -> bytes:
    """The file with one more directory, of long numbers, at which its header points."""
    order = BYTE_ORDERS[data[:4]]
    at = len(data) + len(data) % 2
    tail_at = at + 2 + ENTRY_BYTES * len(values) + 4
    entries, tail = b"", b""
    for tag, numbers in sorted(values.items()):
        packed = struct.pack(f"{order}{len(numbers)}I", *numbers)
        place = packed if len(packed) == 4 else struct.pack(order + "I", tail_at + len(tail))
        tail += b"" if len(packed) == 4 else packed
        entries += struct.pack(order + "HHI", tag, LONG, len(numbers)) + place
    directory = struct.pack(order + "H", len(values)) + entries + struct.pack(order + "I", 0) + tail
    return _pointed_at(data + b"\0" * (at - len(data)) + directory, at)
