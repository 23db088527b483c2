"""Where maps of scans are kept: beside the scan's file, or in the user's folder of this extension."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.locate import LandmarkMap, MapFileError, read_map, write_map
from ..registration import preferences
from ..splat import object as splat_object

log = logging.getLogger(__name__)
SUFFIX = ".gssmc-map"
SCAN_HINT = 8  # letters of the key in a name beside a scan, where a person reads it


@dataclass(frozen=True)
class MapPlace:
    """Where the map of one scan is looked for and written: the first of `folders` that can be written to.

    `stem`: of the scan's file, which the map's name begins with. Needs no Blender.
    """

    folders: tuple[Path, ...]
    stem: str = "scan"

    def files(self, key: str) -> list[Path]:
        """The map's file in each folder; the key, a map's whole identity, is checked again by its reader."""
        return [folder / f"{self.stem}.{key[:SCAN_HINT]}{SUFFIX}" for folder in self.folders]

    def read(self, key: str) -> LandmarkMap | None:
        """The largest map that is there; None where there is none, or none that is whole and this scan's."""
        found = []
        for path in filter(Path.is_file, self.files(key)):
            try:
                found.append(read_map(path, key))
            except MapFileError as error:
                log.warning("%s", error)
        return max(found, key=len, default=None)

    def write(self, made: LandmarkMap) -> Path | None:
        """Keeps the map; the path, None where it can be written nowhere, which costs only the time to make it again."""
        for path in self.files(made.key):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                write_map(path, made)
            except OSError as error:
                log.warning("The map cannot be kept in %s: %s", path.parent, error.strerror)
                continue
            return path
        return None


def map_folder(create: bool = False) -> Path:
    """Where maps lie that are not kept beside their scans: the user's own folder of this extension."""
    return Path(bpy.utils.extension_path_user(preferences.PACKAGE, path="maps", create=create))


def place_of(splat: bpy.types.Object) -> MapPlace:
    """Where the preferences want the map of this splat; the user's folder is the second choice where a scan's is locked."""
    file = Path(bpy.path.abspath(splat.gssmc.file)) if splat.gssmc.file else None
    folders = [map_folder()]
    if file and file.parent.is_dir() and preferences.maps_beside_scans(bpy.context):
        folders.insert(0, file.parent)
    return MapPlace(tuple(folders), file.stem if file else "scan")


def kept(scenes: Iterable[bpy.types.Scene]) -> list[Path]:
    """Every map file in the user's folder, and beside the scans of `scenes`."""
    splats = [obj for scene in scenes for obj in scene.objects if splat_object.is_splat(obj) and obj.gssmc.file]
    folders = {map_folder(), *(Path(bpy.path.abspath(obj.gssmc.file)).parent for obj in splats)}
    return sorted(path for folder in folders if folder.is_dir() for path in folder.glob(f"*{SUFFIX}") if path.is_file())
