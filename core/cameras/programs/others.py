"""Files that hold cameras in a way that is not read: each is named, with what to do about it."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

from ...errors import DatasetError
from ..types import Split
from .parts import begins

# What a file begins with or holds near its beginning, all of it; what the file is; what to give instead.
KINDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (('"t_00"', '"t_23"'), "a single frame of Polycam", "process the capture with ns-process-data and give transforms.json"),
    (
        ('"poses"', '"K"', '"w"'),
        "the metadata of Record3D",
        "process the capture with ns-process-data and give transforms.json",
    ),
    (("<document", "{projectname}.files/"), "a Metashape project", "export its cameras as XML"),
    (("Ogawa",), "an Alembic file", "import it in Blender, whose cameras can be refined"),
    (("fspy",), "an fSpy project", "import it in Blender with fSpy's add-on; its camera can be refined"),
    (("<x:xmpmeta", "xcr:"), "the XMP of one photo by RealityCapture", "export internal and external parameters as CSV"),
)


def detect(path: Path) -> bool:
    return _kind(path) is not None


def read(path: Path, split: Split = "test") -> NoReturn:
    """Raises DatasetError, always."""
    kind, advice = _kind(path) or ("unknown", "give another file")
    raise DatasetError(f"'{path.name}' is {kind}, which is not read; {advice}.")


def _kind(path: Path) -> tuple[str, str] | None:
    start = begins(path) if path.is_file() else ""
    plain = [(signs, kind, advice) for signs, kind, advice in KINDS if all(sign in start for sign in signs)]
    # A short sign counts at the very beginning alone.
    found = [one for one in plain if len(one[0]) > 1 or start.startswith(one[0][0])]
    return (found[0][1], found[0][2]) if found else None
