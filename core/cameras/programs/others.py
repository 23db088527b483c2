"""Files that hold cameras in a way that is not read: each is named, with what to do about it."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

from ...errors import DatasetError
from ...support.picture_names import PICTURES
from ..types import Split
from . import realitycapture_xmp
from .parts import begins

NO_CAMERAS = "give a file of cameras"
# What a file begins with or holds near its beginning, all of it; what the file is; what to give instead.
KINDS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (("<document", "{projectname}.files/"), "a Metashape project", "export its cameras as XML"),
    (("<document", "{projectname}.files\\"), "a Metashape project", "export its cameras as XML"),
    (("Ogawa",), "an Alembic file", "import it in Blender with File > Import > Photo Cameras"),
    (("BLENDER",), "a Blender file", "open it, and export its cameras with File > Export > Photo Cameras"),
    (("ply\n",), "a scan or a mesh", NO_CAMERAS),
    (("ply\r",), "a scan or a mesh", NO_CAMERAS),
    (("%PDF",), "a PDF document", NO_CAMERAS),
    (("PK\3\4",), "an archive", "unpack it, and give the file of cameras in it"),
    (("<", "<BlocksExchange"), "a BlocksExchange file", "export the cameras as Metashape's XML, Bundler or COLMAP instead"),
    (("{", "application/opf"), "a project in the Open Photogrammetry Format", "export the cameras as Bundler or COLMAP"),
    (("{", '"asset"', '"version"', '"nodes"'), "a glTF scene", "import it in Blender, whose cameras can be refined"),
    (("<",), "an XML or HTML file of a kind that is not known", NO_CAMERAS),
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
    ".glb": ("a glTF scene", "import it in Blender, whose cameras can be refined"),
    **dict.fromkeys(PICTURES, ("a picture", NO_CAMERAS)),
    ".abc": ("an Alembic file", "import it in Blender with File > Import > Photo Cameras"),
}
# Of a COLMAP model, the files beside that of its images, and how its own text begins; a pose list may have such a name too.
COLMAP_STEMS, COLMAP_TEXT = ("cameras", "points3D", "rigs", "frames"), ("# Camera list", "# 3D point list", "# Rig", "# Frame")


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
    if path.stem in COLMAP_STEMS and (path.suffix == ".bin" or (path.suffix == ".txt" and start.startswith(COLMAP_TEXT))):
        return "one file of a COLMAP model", "give the model's folder, or its images.txt or images.bin"
    if realitycapture_xmp.detect(path):
        return None
    plain = [(signs, kind, advice) for signs, kind, advice in KINDS if all(sign in start for sign in signs)]
    # A short sign counts at the very beginning alone.
    begun = start.lstrip("\ufeff \r\n\t")
    found = [one for one in plain if begun.startswith(one[0][0])]
    return SUFFIXES.get(path.suffix.lower()) or ((found[0][1], found[0][2]) if found else None)
