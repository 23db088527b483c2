"""How the names of picture files are read: separators, letters' case, composed accents and suffixes differ between systems."""

from __future__ import annotations

import unicodedata

# Of several files with one name that differ in this alone, the first is taken.
SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".avif", ".heic", ".heif", ".jxl", ".exr", ".bmp")
RAW_SUFFIXES = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw")
PICTURES = (*SUFFIXES, *RAW_SUFFIXES)


def parts_of(name: str) -> list[str]:
    """The folders of a name and the file's own, whichever system wrote it; a drive letter is a folder like another."""
    return [part for part in name.replace("\\", "/").strip().split("/") if part not in ("", ".")]


def file_name(name: str) -> str:
    """The name without its folders; empty where there is none."""
    return next(reversed(parts_of(name)), "")


def stem_of(name: str) -> str:
    """The file's own name without a picture's suffix."""
    plain = file_name(name)
    suffix = next((suffix for suffix in PICTURES if plain.lower().endswith(suffix)), "")
    return plain[: len(plain) - len(suffix)] or plain


def spelt(name: str) -> str:
    """What two spellings of one name share: accents composed, in small letters."""
    return unicodedata.normalize("NFC", name).casefold()


def spelt_parts(name: str) -> tuple[str, str]:
    """Stem and suffix of a file's name, spelt alike; a suffix that is none of a picture belongs to the stem."""
    plain = spelt(name)
    suffix = next((suffix for suffix in PICTURES if plain.endswith(suffix)), "")
    return plain[: len(plain) - len(suffix)], suffix
