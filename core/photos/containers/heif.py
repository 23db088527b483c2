"""AVIF and HEIC files (ISO/IEC 14496-12 boxes, ISO/IEC 23008-12 image items): the picture's size, how it is turned, its EXIF.

What a file says of its rotation in boxes ("irot", "imir") is what counts there; the orientation in its EXIF data does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

AVIF_BRANDS, HEIC_BRANDS = (b"avif", b"avis"), (b"heic", b"heix", b"heim", b"heis", b"hevc", b"mif1", b"msf1")
MAX_ITEMS = 1 << 12
# EXIF orientation by quarter turns counter-clockwise and then, if there is one, a flip: top to bottom (0), left to right (1).
ORIENTATIONS = {
    (0, None): 1,
    (1, None): 8,
    (2, None): 3,
    (3, None): 6,
    (0, 0): 4,
    (0, 1): 2,
    (1, 0): 7,
    (1, 1): 5,
    (2, 0): 2,
    (2, 1): 4,
    (3, 0): 5,
    (3, 1): 7,
}


@dataclass(frozen=True)
class HeifFacts:
    """Of the primary picture: `size` as stored, None where it is not told; `orientation` as EXIF numbers it; `exif` the block,
    empty where there is none.
    """

    size: tuple[int, int] | None = None
    orientation: int = 1
    exif: bytes = b""


@dataclass(frozen=True)
class _Box:
    kind: bytes
    body: bytes


def is_avif(data: bytes) -> bool:
    return any(brand in AVIF_BRANDS for brand in _brands(data))


def is_heic(data: bytes) -> bool:
    return not is_avif(data) and any(brand in HEIC_BRANDS for brand in _brands(data))


def read_facts(data: bytes) -> HeifFacts:
    """What the boxes say; the defaults where they are damaged or say nothing."""
    meta = next((box.body[4:] for box in _boxes(data) if box.kind == b"meta"), b"")
    boxes = {box.kind: box.body for box in _boxes(meta)}
    primary = _number(boxes.get(b"pitm", b""), 4, 2 if boxes.get(b"pitm", b"\0")[:1] == b"\0" else 4)
    size: tuple[int, ...] | None = None
    turns, flip = 0, None
    for prop in _properties(boxes.get(b"iprp", b""), primary):
        if prop.kind == b"ispe" and len(prop.body) >= 12:
            size = _number(prop.body, 4, 4), _number(prop.body, 8, 4)
        elif prop.kind == b"clap" and len(prop.body) >= 16 and _number(prop.body, 4, 4) and _number(prop.body, 12, 4):
            # The coded picture is padded; its width and height are fractions here.
            size = tuple(_number(prop.body, at, 4) // _number(prop.body, at + 4, 4) for at in (0, 8))
        elif prop.kind == b"irot" and prop.body:
            turns = prop.body[0] & 3
        elif prop.kind == b"imir" and prop.body:
            flip = prop.body[0] & 1
    return HeifFacts(None if size is None else (size[0], size[1]), ORIENTATIONS[turns, flip], _exif(data, boxes))


def _brands(data: bytes) -> list[bytes]:
    if data[4:8] != b"ftyp":
        return []
    end = min(int.from_bytes(data[:4], "big"), 256)
    return [data[8:12], *(data[at : at + 4] for at in range(16, end - 3, 4))]


def _boxes(data: bytes) -> Iterator[_Box]:
    """The boxes one after the other, the last one cut off where the data end."""
    at = 0
    while at + 8 <= len(data):
        length, kind, head = _number(data, at, 4), data[at + 4 : at + 8], 8
        if length == 1:
            length, head = _number(data, at + 8, 8), 16
        length = length or len(data) - at
        if length < head:
            return
        yield _Box(kind, data[at + head : at + length])
        at += length


def _properties(iprp: bytes, item: int) -> list[_Box]:
    """The properties that belong to an item, in the order in which they are to be applied."""
    inner = {box.kind: box.body for box in _boxes(iprp)}
    known, table = list(_boxes(inner.get(b"ipco", b""))), inner.get(b"ipma", b"")
    version, wide = table[:1] != b"\0", bool(table[3:4] and table[3] & 1)
    at, id_size, width = 8, 4 if version else 2, 2 if wide else 1
    for _ in range(min(_number(table, 4, 4), MAX_ITEMS)):
        owner, count = _number(table, at, id_size), _number(table, at + id_size, 1)
        at += id_size + 1
        if owner == item:
            mask = (1 << (8 * width - 1)) - 1
            numbers = [_number(table, at + i * width, width) & mask for i in range(count)]
            return [known[number - 1] for number in numbers if 0 < number <= len(known)]
        at += count * width
    return []


def _exif(data: bytes, boxes: dict[bytes, bytes]) -> bytes:
    """The TIFF block of the item of type Exif: 4 bytes that say how far away the block begins, then that."""
    item = _exif_item(boxes.get(b"iinf", b""))
    place = None if item is None else _place(boxes.get(b"iloc", b""), item)
    if place is None:
        return b""
    content = data[place[0] : place[0] + place[1]]
    return content[4 + _number(content, 0, 4) :].removeprefix(b"Exif\0\0")


def _exif_item(iinf: bytes) -> int | None:
    for box in _boxes(iinf[6 if iinf[:1] == b"\0" else 8 :]):
        width = 4 if box.body[:1] == b"\3" else 2
        if box.kind == b"infe" and box.body[4 + width + 2 : 8 + width + 2] == b"Exif":
            return _number(box.body, 4, width)
    return None


def _place(iloc: bytes, wanted: int) -> tuple[int, int] | None:
    """(offset, length) in the file of an item that lies there in one piece."""
    version, sizes = iloc[0] if iloc else 0, _number(iloc, 4, 2)
    offset_size, length_size, base_size, index_size = (sizes >> shift & 15 for shift in (12, 8, 4, 0))
    id_size = 4 if version == 2 else 2
    at = 6 + id_size
    for _ in range(min(_number(iloc, 6, id_size), MAX_ITEMS)):
        item, at = _number(iloc, at, id_size), at + id_size
        method = _number(iloc, at, 2) & 15 if version else 0
        at += 4 if version else 2
        base, at = _number(iloc, at, base_size), at + base_size
        extents, at = _number(iloc, at, 2), at + 2
        skipped = index_size if version else 0
        if item == wanted and method == 0 and extents == 1:
            at += skipped
            return base + _number(iloc, at, offset_size), _number(iloc, at + offset_size, length_size)
        at += extents * (skipped + offset_size + length_size)
    return None


def _number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "big")
