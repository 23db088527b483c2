"""The markers of a JPEG file (ITU-T T.81, annex B): its segments, and whether its picture is there to the end.

Phones put more behind the picture's end: a short film (motion photos), further pictures (MPF), an HDR gain map. Only what
stands before the end belongs to the picture, so the file is walked from marker to marker and never searched from its back.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

SIGNATURE = b"\xff\xd8"
END, SCAN, APP1 = 0xD9, 0xDA, 0xE1
FRAMES = (0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
WITHOUT_LENGTH = {0x01, 0xD8}  # TEM and a repeated start; restart markers, which stand inside a scan, the pattern leaves out
# 0xFF may be repeated before a marker. Inside a scan 0xFF 0x00 is a byte of data and 0xD0 to 0xD7 are restart marks.
MARKER = re.compile(rb"\xff+([\x01-\xcf\xd8-\xfe])")


@dataclass(frozen=True)
class Segment:
    """`marker`: the byte after 0xFF; `start`, `end`: where its content, without the length, lies in the file. The content ends
    behind the file's own end where the file is cut off.
    """

    marker: int
    start: int
    end: int


def segments(data: bytes) -> Iterator[Segment]:
    """The segments of a JPEG file up to the end of its picture, whose marker comes last, with no content."""
    at = len(SIGNATURE)
    while found := MARKER.search(data, at):
        marker, at = found[1][0], found.end()
        if marker in WITHOUT_LENGTH:
            continue
        if marker == END:
            yield Segment(marker, at, at)
            return
        end = at + max(2, int.from_bytes(data[at : at + 2], "big")) if at + 2 <= len(data) else len(data) + 1
        yield Segment(marker, at + 2, end)
        at = end


def header_segments(data: bytes) -> Iterator[Segment]:
    """The segments before the pixels."""
    for segment in segments(data):
        if segment.marker == SCAN:
            return
        yield segment


def size(data: bytes) -> tuple[int, int] | None:
    """(width, height) as stored; None where no frame tells it."""
    for segment in header_segments(data):
        frame = data[segment.start : segment.start + 5]  # bits per sample, height, width
        if segment.marker in FRAMES and len(frame) == 5:
            return int.from_bytes(frame[3:], "big"), int.from_bytes(frame[1:3], "big")
    return None


def is_whole(data: bytes) -> bool:
    """Whether the picture goes on to its end marker, whatever follows that."""
    return any(segment.marker == END for segment in segments(data))
