"""Whether a PNG file is whole (PNG specification, section 5): its chunks with their check sums, to the end."""

from __future__ import annotations

import zlib

SIGNATURE = b"\x89PNG\r\n\x1a\n"
HEADER_BYTES, SUM_BYTES = 8, 4
END = b"IEND"
# What the pixels are made of; damage elsewhere, in a text for instance, does no harm.
NEEDED = (b"IHDR", b"PLTE", b"IDAT", END)


def problem(data: bytes) -> str:
    """What is wrong with the file, as part of a sentence; empty when nothing is."""
    view, at = memoryview(data), len(SIGNATURE)
    while at + HEADER_BYTES <= len(data):
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + HEADER_BYTES]
        end = at + HEADER_BYTES + length
        if not kind.isalpha():
            return "is damaged: a part of it has no name"
        if end + SUM_BYTES > len(data):
            break
        if kind in NEEDED and zlib.crc32(view[at + 4 : end]) != int.from_bytes(data[end : end + SUM_BYTES], "big"):
            return "is damaged: a check sum is wrong"
        if kind == END:
            return ""
        at = end + SUM_BYTES
    return "is cut off: the PNG has no end"
