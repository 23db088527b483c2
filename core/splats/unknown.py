"""What a file is that is no splat of a known format, for the sentence that refuses it."""

from __future__ import annotations

SIGNATURES = (
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"LASF", "a LAS point cloud"),
    (b"Kaydara FBX", "an FBX model"),
    (b"\x1f\x8b", "gzip data without an .spz header"),
    (b"\x28\xb5\x2f\xfd", "zstd data"),
    (b"BLENDER", "a .blend file"),
)
TEXT_CHECKED = 512


def name_of(header: bytes) -> str:
    """In words, what begins with `header`."""
    for signature, words in SIGNATURES:
        if header.startswith(signature):
            return words
    text = header[:TEXT_CHECKED]
    if text.lstrip().startswith((b"{", b"[", b"<")):
        return "a JSON, XML or HTML text"
    return "a text" if all(32 <= byte < 127 or byte in b"\t\r\n" for byte in text) else "of an unknown format"
