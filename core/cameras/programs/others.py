"""Files that hold cameras in a way that is not read: each is named, with what to do about it."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

from ...errors import DatasetError
from ..types import Split
from .parts import begins

# What a file begins with or holds near its beginning, all of it; what the file is; what to give instead.
KINDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (("<document", "{projectname}.files/"), "a Metashape project", "export its cameras as XML"),
    (("<document", "{projectname}.files\\"), "a Metashape project", "export its cameras as XML"),
    (("Ogawa",), "an Alembic file", "import it in Blender with File > Import > Photo Cameras"),
)
# What only the name tells, because such a file is an archive like any other.
SUFFIXES = {
    ".psz": ("a Metashape project", "export its cameras as XML"),
    ".psx": ("a Metashape project", "export its cameras as XML"),
    ".rcproj": ("a RealityCapture project", "export internal and external parameters as CSV, or XMP files"),
    ".rsproj": ("a RealityScan project", "export internal and external parameters as CSV, or XMP files"),
    ".rcalign": ("a component of RealityCapture", "export internal and external parameters as CSV, or XMP files"),
    ".p3p": ("a 3DF Zephyr project", "export its cameras as a Bundler or NVM file"),
    ".zep": ("a 3DF Zephyr project", "export its cameras as a Bundler or NVM file"),
    ".p4d": ("a Pix4D project", "export its cameras as a Bundler file"),
    ".mg": ("a Meshroom project", "give cameras.sfm of its StructureFromMotion node"),
    ".fbx": ("an FBX file", "import it in Blender, whose cameras can be refined"),
    ".chan": ("a channel file", "import it in Blender, whose cameras can be refined"),
    ".usd": ("a USD file", "import it in Blender, whose cameras can be refined"),
    ".usda": ("a USD file", "import it in Blender, whose cameras can be refined"),
    ".usdc": ("a USD file", "import it in Blender, whose cameras can be refined"),
    ".abc": ("an Alembic file", "import it in Blender with File > Import > Photo Cameras"),
}


def detect(path: Path) -> bool:
    return _kind(path) is not None


def read(path: Path, split: Split = "test") -> NoReturn:
    """Raises DatasetError, always."""
    kind, advice = _kind(path) or ("unknown", "give another file")
    raise DatasetError(f"'{path.name}' is {kind}, which is not read; {advice}.")


def _kind(path: Path) -> tuple[str, str] | None:
    if not path.is_file():
        return None
    start = begins(path)
    plain = [(signs, kind, advice) for signs, kind, advice in KINDS if all(sign in start for sign in signs)]
    # A short sign counts at the very beginning alone.
    found = [one for one in plain if len(one[0]) > 1 or start.startswith(one[0][0])]
    return (found[0][1], found[0][2]) if found else SUFFIXES.get(path.suffix.lower())
