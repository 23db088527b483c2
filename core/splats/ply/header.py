"""The header of a PLY file: elements, properties, and where the body begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO

from ...errors import SplatFormatError

MAX_HEADER_BYTES = 1 << 20
QUOTED_CHARACTERS = 60
# A count with more digits does not fit into the numbers that files and iterators are measured in.
MAX_COUNT_DIGITS = 18
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("int64", "long"), "i8"),
    **dict.fromkeys(("uint64", "ulong"), "u8"),
    **dict.fromkeys(("half", "float16"), "f2"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


@dataclass(frozen=True)
class PlyProperty:
    """`type` is a numpy type code without byte order; `count_type` that of a list's length, empty for a scalar."""

    name: str
    type: str
    count_type: str = ""


@dataclass(frozen=True)
class PlyElement:
    """`count` rows of `properties`, as the header promises them."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.count_type for p in self.properties)


@dataclass(frozen=True)
class PlyHeader:
    """`byte_order` is "<", ">" or "" for ascii; `size` the header's length in bytes; `comments` without their first word."""

    byte_order: str
    elements: tuple[PlyElement, ...]
    size: int
    comments: tuple[str, ...] = ()

    def element(self, name: str) -> PlyElement | None:
        return next((e for e in self.elements if e.name == name), None)


def read_header(file: IO[bytes]) -> PlyHeader:
    """Parse the header from the start of `file`, leaving it at the body's first byte.

    Raises SplatFormatError when it is no PLY header.
    """
    lines: list[list[str]] = []
    while True:
        raw = file.readline(MAX_HEADER_BYTES)
        words = raw.decode("latin-1").split()
        if not lines and words != ["ply"]:
            raise SplatFormatError("The file does not begin with 'ply', so it is no PLY file; choose a Gaussian splat .ply.")
        if not raw.endswith(b"\n") or file.tell() > MAX_HEADER_BYTES:
            raise SplatFormatError("The PLY header has no end_header line; the file is damaged or cut off, so export it again.")
        if words == ["end_header"]:
            break
        lines.append(words or ["comment"])
    comments = tuple(" ".join(words[1:]) for words in lines if words[0] == "comment")
    return PlyHeader(_byte_order(lines), _elements(lines), file.tell(), comments)


def _byte_order(lines: list[list[str]]) -> str:
    for words in lines:
        if words[0] == "format" and len(words) >= 2:
            if words[1] in BYTE_ORDERS:
                return BYTE_ORDERS[words[1]]
            raise SplatFormatError(
                f"The PLY format '{words[1]}' is unknown; ascii and binary (little, big endian) can be read."
            )
    raise SplatFormatError("The PLY header has no format line; the file is damaged, so export it again.")


def _elements(lines: list[list[str]]) -> tuple[PlyElement, ...]:
    found: list[tuple[str, int, list[PlyProperty]]] = []
    for words in lines:
        if words[0] == "element":
            if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > MAX_COUNT_DIGITS:
                raise SplatFormatError(f"The PLY header line '{_quoted(words)}' is not 'element NAME COUNT'; export it again.")
            found.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            if not found:
                raise SplatFormatError(
                    "The PLY header has a property before any element; the file is damaged, so export it again."
                )
            found[-1][2].append(_property(words))
    return tuple(PlyElement(name, count, tuple(properties)) for name, count, properties in found)


def _property(words: list[str]) -> PlyProperty:
    types = words[2:-1] if words[1:2] == ["list"] else words[1:-1]
    want = 2 if words[1:2] == ["list"] else 1
    if len(types) != want or not all(t in TYPES for t in types) or (TYPES[types[0]].startswith("f") and want == 2):
        raise SplatFormatError(
            f"The PLY header line '{_quoted(words)}' is no property known; export the file with float values."
        )
    return PlyProperty(words[-1], TYPES[types[-1]], TYPES[types[0]] if want == 2 else "")


def _quoted(words: list[str]) -> str:
    """A header line for a sentence, which a damaged file must not make endless."""
    line = " ".join(words)
    return line if len(line) <= QUOTED_CHARACTERS else line[:QUOTED_CHARACTERS] + "..."
