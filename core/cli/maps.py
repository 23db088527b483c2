"""What the commands that find photos without a start have in common: the map's flags, its cache, and progress in words."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import fields
from functools import cached_property
from pathlib import Path

from ..errors import UsageError
from ..geometry.camera import Camera
from ..locate import FindProgress, FindReport, LandmarkMap, MapCache, MapPlace, MapSettings, PhotoLens, find_camera, map_key
from ..locate.known_cameras import cameras_beside, read_known
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer
from ..splats import GaussianScene
from ..support.atomic import check_writable
from ..support.words import counted
from .console import message
from .flags import whole_number
from .paths import check_outputs
from .progress import ProgressBar

CACHES = ("scan", "user")
NO_CAMERAS = Path("none")
VIEWS = next(field.default for field in fields(MapSettings) if field.name == "views")


def add_map_flags(parser: argparse.ArgumentParser, switch: bool = False) -> None:
    """--map, --cameras, --views, --map-cache; with `switch` also --no-locate."""
    group = parser.add_argument_group("finding photos without a start")
    if switch:
        text = "do not search for photos that have no start, or whose refinement from their start failed"
        group.add_argument("--no-locate", dest="locate", action="store_false", help=text)
    group.add_argument("--map", type=Path, metavar="FILE", help="where the scan's map is kept (see --map-cache)")
    known = "cameras that saw what the scan was trained on, in its coordinates: the map begins with them (camera JSON, COLMAP, "
    beside = "transforms.json, ...); without it those that a training left beside the scan; none: not those either"
    group.add_argument("--cameras", type=Path, metavar="FILE_OR_DIR", help=known + beside)
    group.add_argument("--views", type=whole_number, metavar="N", help=f"most views of the map ({VIEWS})")
    where = "where the map is kept without --map: beside the scan (where that can be written) or in the user's cache folder"
    group.add_argument("--map-cache", choices=CACHES, default=CACHES[0], help=f"{where} ({CACHES[0]})")


def stored_map(scan: Path) -> Path | None:
    """The map that lies beside the scan; None where there is none."""
    beside = MapPlace(scan).files("")[0]
    return beside if beside.is_file() else None


def check_results(outputs: Mapping[str, Path | None], scan: Path) -> None:
    """Raises UsageError, before any work, when a file of results would overwrite the scan's map, or is a folder."""
    for flag, path in outputs.items():
        if path is not None and path.is_dir():
            raise UsageError(f"{flag} '{path}' is a folder; give a file.")
    check_outputs(outputs, {"the scan's map": stored_map(scan)})


class MapFlags:
    """What the flags of `add_map_flags` say. Raises RefineError, UsageError, DatasetError or CameraError."""

    def __init__(self, args: argparse.Namespace, threads: int = 0) -> None:
        if not getattr(args, "locate", True) and (args.map or args.cameras or args.views is not None):
            raise UsageError(
                "--map, --cameras and --views are for finding photos, which --no-locate switches off; leave one out."
            )
        self.settings = MapSettings(threads=threads) if args.views is None else MapSettings(args.views, threads=threads)
        self.place = MapPlace(args.scene, args.map, args.map_cache == "scan")
        self.place.check()
        self._args = args
        if args.cameras is not None and args.cameras != NO_CAMERAS:
            self.known = read_known(args.cameras)
            all_of = counted(len(self.known), "camera")
            message(f"The map begins with up to {self.settings.views} of {all_of} in '{args.cameras}'.")

    @cached_property
    def known(self) -> list[Camera]:
        """The cameras that --cameras names or, without it, those that lie beside the scan; read where they are used."""
        found = cameras_beside(self._args.scene) if self._args.cameras is None else None
        if found is None:
            return []
        message(f"Known cameras read from '{found[0]}' ({len(found[1])}); --cameras none leaves them out.")
        return found[1]

    @property
    def word(self) -> str:
        """What of the flags an answer depends on, as one word."""
        return map_key("", self.settings, self.known)

    def check_writable(self) -> None:
        """Raises UsageError, before any view is drawn, where no file can be written that would keep the map."""
        files, reasons = self.place.files(""), []
        for file in files:
            try:
                check_writable(file)
                return
            except OSError as error:
                reasons.append(error.strerror)
        raise UsageError(f"The map cannot be written to '{files[0]}' ({reasons[0]}); give another file with --map.")

    def cache(self, scene: GaussianScene) -> MapCache:
        return MapCache(scene, self.place, self.settings, [camera.relative_to(scene.origin) for camera in self.known])


@contextmanager
def _telling_where(cache: MapCache) -> Iterator[None]:
    """Says where the map is kept, if it was not kept anywhere before."""
    before = cache.stored_in()
    yield
    file = cache.stored_in()
    if before is None and file is not None:
        message(f"The scan's map, which finds its photos, is kept in '{file}'; --map puts it elsewhere.")


def whole_map(cache: MapCache) -> LandmarkMap:
    """The map to its end, made where it is not stored, with progress."""
    with _telling_where(cache), ProgressBar("Mapping") as bar, closing(cache.steps()) as steps:  # type: ignore[type-var]
        made = LandmarkMap(cache.key)
        for step in steps:
            made = step.map
            bar.show(step.fraction, f"{step.step}, {counted(len(made), 'view')}")
    return made


def find_with_progress(renderer: ViewRenderer, target: PhotoLens, cache: MapCache, settings: RefineSettings) -> FindReport:
    """The photo's camera without a start; no more of the map is made than the photo needs, and what is made is stored."""
    with _telling_where(cache), ProgressBar("Finding") as bar, closing(cache.steps()) as steps:  # type: ignore[type-var]

        def show(progress: FindProgress) -> None:
            refining = f", {progress.refining.step}" if progress.refining else ""
            bar.show(progress.fraction, f"{progress.step}{refining}, {counted(progress.views, 'view')}")

        found = find_camera(renderer, target, steps, settings, show)
        bar.show(1.0, found.verdict)
    return found
