"""The splats that the viewport knows: from a point cloud's attributes to textures, without holding the window up.

Blender's memory is read one attribute per tick in the main thread; tables are built in the back thread; textures are sent one
per redraw. A checksum tells real changes from Blender's many other reasons to call a point cloud updated.
"""

from __future__ import annotations

import itertools
import zlib
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.errors import SplatFormatError
from ..splat import object as splat_object
from .data import SplatTables, build_tables
from .gpu import SplatTextures
from .thread import BackThread

ATTRIBUTES = (("position", 3), ("scale", 3), ("rotation", 4), (splat_object.BASE, 4))
LIMIT = 4096 * 16384  # As many as fit into tables of the largest usual texture size.


@dataclass(frozen=True)
class Prepared:
    """Tables with the checksum of the arrays that they were made of."""

    tables: SplatTables | None  # None when the arrays have not changed.
    checksum: int


def prepare(arrays: tuple[np.ndarray, ...], known: int | None = None) -> Prepared:
    """Tables of means, scales, rotations and base; fit for a worker thread."""
    checksum = 0
    for array in arrays:
        checksum = zlib.crc32(np.ascontiguousarray(array, np.float32), checksum)
    means, scales, rotations, base = arrays
    tables = None if checksum == known else build_tables(means, scales, rotations, base, LIMIT)
    return Prepared(tables, checksum)


@dataclass
class _Cloud:
    textures: SplatTextures | None = None
    checksum: int | None = None
    stale: bool = True
    reading: list[np.ndarray] | None = None  # attributes read so far
    version: int = 0


class Clouds:
    """Known splats by the session id of their point cloud."""

    def __init__(self, thread: BackThread) -> None:
        self._thread = thread
        self._clouds: dict[int, _Cloud] = {}
        # Counted over all splats, so that one that comes back by redo is never mistaken for another.
        self._versions = itertools.count(1)

    def get(self, uid: int) -> tuple[SplatTextures | None, int]:
        """Textures, or None until there are some, and their version; asking makes a splat known."""
        cloud = self._clouds.setdefault(uid, _Cloud())
        return cloud.textures, cloud.version

    def accept(self, uid: int, prepared: Prepared | None) -> bool:
        """Takes over what the back thread, or an import, has prepared. None: it failed; the splat is not tried again.

        True when the splat is another one now.
        """
        cloud = self._clouds.setdefault(uid, _Cloud())
        cloud.reading = None
        if prepared is None:
            return False
        cloud.checksum, cloud.stale = prepared.checksum, False
        if prepared.tables is None:
            return False
        cloud.textures = SplatTextures(prepared.tables)
        cloud.version = next(self._versions)
        return True

    def mark_stale(self, uid: int) -> None:
        """The point cloud of that session id is read anew, if it is known."""
        cloud = self._clouds.get(uid)
        if cloud:
            cloud.stale = True

    def mark_all_stale(self) -> None:
        """Every point cloud is read anew: after undo, ids stay and contents may not."""
        for cloud in self._clouds.values():
            cloud.stale = True

    def step(self) -> bool:
        """Reads one attribute of one splat that needs it, and forgets splats that are gone; True while there is more to do."""
        living = {cloud.session_uid: cloud for cloud in bpy.data.pointclouds}
        for uid in [uid for uid in self._clouds if uid not in living]:
            del self._clouds[uid]
        for uid, cloud in self._clouds.items():
            if cloud.stale:
                self._read(uid, cloud, living[uid])
                return True
        return False

    def _read(self, uid: int, cloud: _Cloud, block: bpy.types.PointCloud) -> None:
        arrays = cloud.reading or []
        name, width = ATTRIBUTES[len(arrays)]
        try:
            arrays.append(splat_object.read_attribute(block, name, width))
        except (SplatFormatError, KeyError):  # It was edited and is no splat any more.
            cloud.stale, cloud.reading, cloud.textures = False, None, None
            return
        cloud.reading = arrays
        if len({len(array) for array in arrays}) > 1:  # Points were added or removed meanwhile, so reading starts again.
            cloud.reading = None
        elif len(arrays) == len(ATTRIBUTES):
            cloud.stale, cloud.reading = False, None
            known = cloud.checksum
            self._thread.ask(("cloud", uid), lambda: prepare(tuple(arrays), known))

    def clear(self) -> None:
        """Forgets all, for another file was opened or the extension is switched off."""
        self._clouds.clear()
