"""OpenEXR files of float channels: written uncompressed or as ZIP, read as most programs write them (scan lines; none, RLE,
ZIPS and ZIP).

By the file layout that the OpenEXR project documents. OpenCV has its own codec for the format switched off.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Container, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import PhotoError
from ...support.atomic import atomic_write

Channel = NDArray[np.float32]
Box = tuple[int, int, int, int]  # left, top, right, bottom, the last two included

MAGIC, VERSION = b"\x76\x2f\x31\x01", 2
TILED, LONG_NAMES, DEEP, PARTS = 0x200, 0x400, 0x800, 0x1000
SHORT_NAME = 31
ZIP_LEVEL = 4
PIXEL_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
HALF, FLOAT = 1, 2
NONE, RLE, ZIPS, ZIP = range(4)
ROWS_IN_CHUNK = {NONE: 1, RLE: 1, ZIPS: 1, ZIP: 16}
MAX_NAME, MAX_CHANNELS, MAX_PIXELS = 256, 32, 64 << 20
# What a byte of a compressed file may stand for at most, so that a damaged one does not ask for endless memory.
MOST_UNPACKED = 1100


@dataclass(frozen=True)
class _ExrHeader:
    """What of a file's header is needed; `channels` are (name, pixel type) in the file's order, `at` is where it ends."""

    channels: tuple[tuple[str, int], ...]
    compression: int
    data: Box
    display: Box
    at: int


def write_exr(path: Path, channels: Mapping[str, Channel], half: Container[str] = (), packed: bool = False) -> None:
    """Write channels (H, W) by name, row 0 on top; the file appears whole or not at all.

    They are 32-bit floats, those named in `half` 16-bit ones. `packed`: compressed as ZIP, without loss.
    """
    names = sorted(channels)
    height, width = channels[names[0]].shape
    kinds = {name: HALF if name in half else FLOAT for name in names}
    row = np.dtype([(name, PIXEL_TYPES[kinds[name]], (width,)) for name in names])
    whole = np.zeros(height, row)
    for name in names:
        whole[name] = channels[name]
    compression = ZIP if packed else NONE
    count = ROWS_IN_CHUNK[compression]
    plain = [whole[y : y + count].tobytes() for y in range(0, height, count)]
    chunks = [_packed(data) for data in plain] if packed else plain
    header = _written_header(kinds, (width, height), compression)
    sizes = np.array([8 + len(chunk) for chunk in chunks], "<u8")
    offsets = len(header) + 8 * len(chunks) + np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype("<u8")
    with atomic_write(path, "wb", one_of_many=True) as file:
        file.write(header)
        file.write(offsets.astype("<u8").tobytes())
        for number, chunk in enumerate(chunks):
            file.write(struct.pack("<2i", number * count, len(chunk)))
            file.write(chunk)


def _written_header(kinds: Mapping[str, int], size: tuple[int, int], compression: int) -> bytes:
    box = struct.pack("<4i", 0, 0, size[0] - 1, size[1] - 1)
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name, kind in kinds.items()) + b"\0"
    long_names = LONG_NAMES if any(len(name) > SHORT_NAME for name in kinds) else 0
    header = MAGIC + struct.pack("<i", VERSION | long_names)
    for name, kind_name, value in (
        ("channels", "chlist", listed),
        ("compression", "compression", bytes([compression])),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ):
        header += name.encode() + b"\0" + kind_name.encode() + b"\0" + struct.pack("<i", len(value)) + value
    return header + b"\0"


def _packed(data: bytes) -> bytes:
    """A chunk as ZIP has it: even and odd bytes apart, told as differences; as it is where that is no shorter."""
    plain = np.frombuffer(data, np.uint8)
    steps = np.concatenate([plain[0::2], plain[1::2]])
    steps[1:] = steps[1:] - steps[:-1] + np.uint8(128)
    packed = zlib.compress(steps.tobytes(), ZIP_LEVEL)
    return packed if len(packed) < len(data) else data


def read_exr(path: Path) -> dict[str, Channel]:
    """The channels (H, W) of the display window by name, as float32, NaN where the file has no data. Raises PhotoError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PhotoError(f"'{path}' cannot be read ({error.strerror}); check the path.") from error
    return channels_of(data, path.name)


def channels_of(data: bytes, name: str) -> dict[str, Channel]:
    """As `read_exr`, of the content of the file `name`. Raises PhotoError."""
    try:
        header = _header(data)
        return _pixels(data, header)
    except _UnreadError as error:
        raise PhotoError(f"'{name}' {error}.") from None
    except (struct.error, ValueError, IndexError, KeyError, OverflowError, zlib.error, UnicodeDecodeError):
        raise PhotoError(f"'{name}' is no whole OpenEXR file; write it again.") from None


def read_light(data: bytes, name: str) -> Channel:
    """Red, green, blue and alpha (H, W, 4) float32 of a file's content, grey as all three, without alpha 1. Of a file of layers
    the one that is named first. Raises PhotoError.
    """
    channels = channels_of(data, name)
    for colours in ("RGB", "YYY"):
        layers = [found[: -len(colours[0])] for found in channels if found == colours[0] or found.endswith("." + colours[0])]
        layers = [layer for layer in layers if all(layer + c in channels for c in colours)]
        if layers:
            layer = min(layers, key=lambda one: (one != "", list(channels).index(one + colours[0])))
            planes = [channels[layer + c] for c in colours]
            alpha = channels.get(layer + "A")
            return np.stack([*planes, np.ones_like(planes[0]) if alpha is None else alpha], axis=2)
    raise PhotoError(f"'{name}' has the channels {', '.join(channels)}; a picture has R, G and B, or Y.")


class _UnreadError(ValueError):
    """What is wrong with a file, as the second half of a sentence."""


def _header(data: bytes) -> _ExrHeader:
    if data[:4] != MAGIC:
        raise _UnreadError("is no OpenEXR file; give one")
    flags = struct.unpack_from("<i", data, 4)[0]
    if flags & (TILED | DEEP | PARTS):
        raise _UnreadError("has tiles, several parts or deep pixels; write it as one picture of scan lines")
    at, found = 8, dict[str, bytes]()
    while data[at] != 0:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        found[name] = data[at + 4 : at + 4 + size]
        if size < 0 or len(found[name]) != size:
            raise ValueError
        at += 4 + size
    compression = found["compression"][0]
    if compression not in ROWS_IN_CHUNK:
        raise _UnreadError("is compressed in a way that is not read; write it uncompressed or as ZIP")
    boxes = [struct.unpack("<4i", found[key]) for key in ("dataWindow", "displayWindow")]
    for left, top, right, bottom in boxes:
        size = right - left + 1, bottom - top + 1
        if min(size) < 1 or size[0] * size[1] > MAX_PIXELS:
            raise _UnreadError(f"says that it has {size[0]} x {size[1]} pixels; at most {MAX_PIXELS >> 20} million can be read")
    channels = tuple(_channels(found["channels"]))
    if not 0 < len(channels) <= MAX_CHANNELS:
        raise _UnreadError(f"has {len(channels)} channels; write the wanted ones alone")
    return _ExrHeader(channels, compression, boxes[0], boxes[1], at + 1)


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(b"\0", at, at + MAX_NAME)
    return data[at:end].decode(), end + 1


def _channels(data: bytes) -> list[tuple[str, int]]:
    at, out = 0, []
    while data[at] != 0:
        name, at = _text(data, at)
        kind, _, sx, sy = struct.unpack_from("<iB3xii", data, at)
        if (sx, sy) != (1, 1):
            raise _UnreadError("has channels of fewer pixels than others; write them all in full")
        out.append((name, kind))
        at += 16
    return out


def _pixels(data: bytes, header: _ExrHeader) -> dict[str, Channel]:
    left, top, right, bottom = header.data
    width, height = right - left + 1, bottom - top + 1
    rows = ROWS_IN_CHUNK[header.compression]
    row = np.dtype([(name, PIXEL_TYPES[kind], (width,)) for name, kind in header.channels])
    if height * row.itemsize > len(data) * (1 if header.compression == NONE else MOST_UNPACKED):
        raise ValueError
    whole = np.zeros(height, row)
    for offset in np.frombuffer(data, "<u8", -(-height // rows), header.at):
        y, size = struct.unpack_from("<2i", data, int(offset))
        first = y - top
        count = min(rows, height - first)
        packed = data[int(offset) + 8 : int(offset) + 8 + size]
        if first < 0 or count < 1 or len(packed) != size:
            raise ValueError
        wanted = count * row.itemsize
        plain = packed if header.compression == NONE or size >= wanted else _unpacked(packed, header.compression, wanted)
        whole[first : first + count] = np.frombuffer(plain, row, count)
    return {name: _displayed(whole[name].astype(np.float32), header) for name, _ in header.channels}


def _displayed(channel: Channel, header: _ExrHeader) -> Channel:
    """The channel of the data window, in the display window."""
    (left, top, right, bottom), (dl, dt, dr, db) = header.display, header.data
    out = np.full((bottom - top + 1, right - left + 1), np.nan, np.float32)
    x0, x1, y0, y1 = max(left, dl), min(right, dr) + 1, max(top, dt), min(bottom, db) + 1
    if x0 < x1 and y0 < y1:
        out[y0 - top : y1 - top, x0 - left : x1 - left] = channel[y0 - dt : y1 - dt, x0 - dl : x1 - dl]
    return out


def _unpacked(packed: bytes, compression: int, size: int) -> bytes:
    """The rows of a chunk: bytes that were split into even and odd ones, and then told as differences."""
    if compression == RLE:
        plain = _run_lengths(packed)
    else:
        unzip = zlib.decompressobj()
        plain = unzip.decompress(packed, size + 1)
    if len(plain) != size:
        raise ValueError
    steps = np.frombuffer(plain, np.uint8).astype(np.int64)
    steps[1:] -= 128
    summed = np.cumsum(steps).astype(np.uint8)
    out, half = np.empty(size, np.uint8), (size + 1) // 2
    out[0::2], out[1::2] = summed[:half], summed[half:]
    return out.tobytes()


def _run_lengths(packed: bytes) -> bytes:
    at, out = 0, bytearray()
    while at < len(packed):
        (count,) = struct.unpack_from("<b", packed, at)
        if count < 0:
            out += packed[at + 1 : at + 1 - count]
            at += 1 - count
        else:
            out += packed[at + 1 : at + 2] * (count + 1)
            at += 2
    return bytes(out)
