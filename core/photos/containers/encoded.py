"""A photo's pixels as its file holds them, before they are decoded."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EncodedPicture:
    """`parts`: files to be decoded, one for the whole picture or one grey one for each of its planes; `size` (width, height) as
    stored, None where it cannot be told beforehand; `orientation` 1..8 as EXIF numbers it; whether the decoder turns the pixels
    by itself. `raw_kind`: what kind of a raw photo it is, which `raw` develops; empty for a picture.
    """

    parts: tuple[bytes, ...]
    size: tuple[int, int] | None
    orientation: int = 1
    turned_by_decoder: bool = False
    raw_kind: str = ""

    @property
    def pixels(self) -> int:
        """How many there are; 0 where that cannot be told."""
        return self.size[0] * self.size[1] if self.size else 0
