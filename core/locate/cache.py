"""Where a scan's map is kept between photos: beside the scan, or in the user's cache folder.

A stored map is believed only where its key says that it is of this scan, these settings and this version; any other is made
again. Files appear whole or not at all, so that several processes may use one: at worst each makes the map, and the last
stays. An unfinished map is kept as well: its views are used at once, and the rest is made when a photo needs it.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from ..geometry.camera import Camera
from ..splats.scene import GaussianScene
from ..support.arrays_file import ArraysFileError
from ..support.cache_folder import user_cache_folder
from .build import MapStep, build_map
from .file import MapFileError, map_key, read_head, read_map, scan_digest, write_map
from .landmarks import LandmarkMap
from .settings import MapSettings

log = logging.getLogger(__name__)

SUFFIX = ".gssmc-map"
SAVE_EVERY = 10  # views; what a killed process loses at most
ANY_VIEWS = 1  # stands for the number of views in a key: every prefix of a map is a map, so that a key names no number
KNOWN_DIGITS = 16


@dataclass(frozen=True)
class MapPlace:
    """Where the map of the splat file `scan` is kept: in `file` alone where it is given, else beside the scan and, where that
    folder cannot be written or `beside` is False, in the user's cache folder under a name made of the scan's content.
    """

    scan: Path
    file: Path | None = None
    beside: bool = True

    def files(self, key: str) -> tuple[Path, ...]:
        """The files to look into and to write to, the first choice first."""
        if self.file is not None:
            return (self.file,)
        scan = Path(os.path.realpath(self.scan))
        users = user_cache_folder() / f"{key}{SUFFIX}"
        return (scan.with_name(scan.name + SUFFIX), users) if self.beside else (users,)

    def check(self) -> None:
        """Raises MapFileError when the given file is something else than a map, which must not be written over."""
        if self.file is None or self.file.suffix == SUFFIX or not self.file.exists() or _head(self.file):
            return
        raise MapFileError(f"'{self.file}' exists and is no map of a scan; give another file for the map.")


class MapCache:
    """The stored map of one scan. Reading never fails: what cannot be believed is logged, and made again."""

    def __init__(self, scene: GaussianScene, place: MapPlace, settings: MapSettings, known: Sequence[Camera] = ()) -> None:
        """`known`: as for `build_map`. Without any, a map that was made with known cameras is taken as well, for it finds no
        less. Raises MapFileError where `place` names a file that is something else.
        """
        place.check()
        self._scene, self._settings, self._known = scene, settings, tuple(known)
        base = replace(settings, views=ANY_VIEWS)
        self._scan_key = map_key(scan_digest(scene), base)
        self.key = f"{self._scan_key}.{map_key('', base, known)[:KNOWN_DIGITS] if known else ''}"
        self.files = place.files(self._scan_key)
        self._told = False  # that it cannot be written

    def read(self) -> LandmarkMap:
        """The stored map, with no more views than the settings ask for; `complete` where none are left to be made. Empty
        where there is none that can be believed.
        """
        best = self._best(quiet=False)
        if best is None:
            return LandmarkMap(self.key)
        stored = best[1]
        views = stored.views[: self._settings.views]
        return LandmarkMap(stored.key, views, stored.complete or len(views) == self._settings.views, stored.search)

    def steps(self) -> Iterator[MapStep]:
        """The map in steps, as of `build_map`: stored views first, then new ones, which are stored too.

        Whoever closes the iteration, or ends it by an error, leaves what was made so far in the file.
        """
        kept = self.read()
        wanted = self._settings.views
        for size in range(1, len(kept) + 1):
            # The end of what is stored counts as whole, so that a photo is tried on it before more of the map is made.
            part = LandmarkMap(kept.key, kept.views[:size], complete=size == len(kept))
            yield MapStep(part, "reading the map", size / wanted)
        if kept.complete:
            yield MapStep(kept, "the map is complete", 1.0)
            return
        yield from self._made(kept)

    def stored_in(self) -> Path | None:
        """The file that `read` takes the map from, None where there is none."""
        best = self._best()
        return None if best is None else best[0]

    def keep(self, made: LandmarkMap) -> Path | None:
        """Stores the map, unless there is one with as many views; the file that holds it, None where none can be written."""
        for file in self.files:
            stored = self._read(file, quiet=True)
            if stored is not None and stored.key == made.key and (len(stored), stored.complete) >= (len(made), made.complete):
                return file
            try:
                write_map(file, made)
            except OSError as error:
                log.info("the map cannot be written to '%s' (%s)", file, error.strerror or error)
                continue
            return file
        if not self._told:  # A map that grows is written several times.
            log.warning("The map cannot be written to '%s'; it is made again the next time.", self.files[0])
        self._told = True
        return None

    def _made(self, kept: LandmarkMap) -> Iterator[MapStep]:
        """Makes what the map lacks, from where its making stopped."""
        wanted, last = self._settings.views, kept
        own = kept.key == self.key
        skip = len(kept) if own else 0
        work = build_map(self._scene, self._settings, self._known, self.key, kept if own else None)
        try:
            with closing(work) as steps:  # type: ignore[type-var]
                for step in steps:
                    views = (*kept.views, *step.map.views[skip:])[:wanted]
                    full = len(views) == wanted
                    made = LandmarkMap(kept.key, views, step.map.complete or full, step.map.search if own else None)
                    # What is stored as complete has no more views to give, however many are asked for.
                    if len(views) > len(last) or step.map.complete:
                        due = len(views) // SAVE_EVERY > len(last) // SAVE_EVERY
                        last = replace(made, complete=step.map.complete and not full)
                        if due and not full:
                            self.keep(last)
                    yield MapStep(made, step.step, 1.0 if made.complete else max(step.fraction, len(kept) / wanted))
                    if made.complete:
                        return
        finally:
            if len(last) > len(kept) or last.complete:
                self.keep(last)

    def _best(self, quiet: bool = True) -> tuple[Path, LandmarkMap] | None:
        found = [(file, one) for file in self.files if (one := self._read(file, quiet)) is not None]
        return max(found, key=lambda one: (one[1].complete, len(one[1])), default=None)

    def _read(self, file: Path, quiet: bool = False) -> LandmarkMap | None:
        if not file.exists():
            return None
        key = str(_head(file).get("key", ""))
        own = key.startswith(f"{self._scan_key}.")
        try:
            return read_map(file, key if own and not self._known else self.key)
        except MapFileError as error:
            if not quiet:
                log.warning("%s This is done where it is needed.", error)
            return None


def _head(file: Path) -> dict[str, object]:
    """The head of a map's file; empty where it is none."""
    try:
        return read_head(file)
    except (OSError, ArraysFileError):
        return {}
