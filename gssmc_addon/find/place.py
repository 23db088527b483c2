"""Where maps of scans are kept: beside the scan's file, or in the user's cache folder, which the command line uses as well."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy

from ...core.locate import MapPlace
from ...core.locate.cache import SUFFIX
from ...core.support.cache_folder import user_cache_folder
from ..registration import preferences
from ..splat import object as splat_object


def place_of(splat: bpy.types.Object) -> MapPlace:
    """Where the preferences want the map of this splat; the cache folder too where its file is not known, or its folder is
    locked.
    """
    file = _file(splat)
    beside = file is not None and file.parent.is_dir() and preferences.maps_beside_scans(bpy.context)
    return MapPlace(file or Path(splat.name), beside=beside)


def kept(scenes: Iterable[bpy.types.Scene]) -> list[Path]:
    """Every map in the cache folder, and beside the scans of `scenes`."""
    splats = [obj for scene in scenes for obj in scene.objects if splat_object.is_splat(obj)]
    beside = {file.with_name(file.name + SUFFIX) for file in map(_file, splats) if file}
    return sorted(path for path in {*user_cache_folder().glob(f"*{SUFFIX}"), *beside} if path.is_file())


def _file(splat: bpy.types.Object) -> Path | None:
    """The scan's file; it may be gone. None for a splat that another importer made."""
    return Path(bpy.path.abspath(splat.gssmc.file)).resolve() if splat.gssmc.file else None
