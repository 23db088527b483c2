"""Making the map, view by view; whoever stops has a smaller map that is as valid, and can go on from there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.camera import Camera, Intrinsics
from ..render.tables import SceneTables, build_tables
from ..splats.scene import GaussianScene
from ..support.steps import converted
from .file import map_key, scan_digest
from .landmarks import LandmarkMap, MapView
from .settings import MapSettings
from .viewpoints.explore import FIRST_LOOKS, Explorer
from .viewpoints.eye import Eye, square_camera
from .viewpoints.known import expected_depth, spread_cameras
from .viewpoints.scout import SCOUT_PX, Scout
from .viewpoints.sieve import sieved
from .viewpoints.surface import sample_surface
from .viewpoints.thin import share_for, thinned

SURFACE_POINTS = 10_000
KNOWN_SIDE = 1.25  # of a view's side: known cameras see what photos see, so that finer renders pay
# What the search costs before the first view, in views of a scan of MEASURED_GAUSSIANS; of others a view costs more or less.
SIEVE_VIEWS, MEASURED_GAUSSIANS = 8.0, 150_000
LOOK_VIEWS, MOST_LOOKS = 0.25, 3  # of one look; looks between two views that are counted at most
FIRST_VIEWS = LOOK_VIEWS * FIRST_LOOKS
SEARCH_STEP = "looking for viewpoints"


@dataclass(frozen=True)
class MapStep:
    """One step of the making: the map so far, what was done, and the `fraction` 0..1 of the whole."""

    map: LandmarkMap
    step: str
    fraction: float


def build_map(
    scene: GaussianScene,
    settings: MapSettings | None = None,
    known: Sequence[Camera] = (),
    key: str = "",
    begun: LandmarkMap | None = None,
) -> Iterator[MapStep]:
    """The map in steps, each with all views so far; stopping the iteration leaves the last step's map.

    `known` cameras (poses in the splat file's coordinates) become views first of all, spread out. `key` as `file.map_key`
    gives it saves reading the scan once more. `begun`: a smaller map of the same key, that of an earlier step; the work goes
    on from it as if it had never stopped.
    """
    settings = settings or MapSettings()
    made = begun or LandmarkMap(key or map_key(scan_digest(scene), settings, known))
    yield MapStep(made, "reading the scan's surface", 0.0)
    yield from _Maker(scene, settings, made).steps(known)


class _Maker:
    """One map in the making. Its work is counted in views, that before the first view as well."""

    def __init__(self, scene: GaussianScene, settings: MapSettings, made: LandmarkMap) -> None:
        self._scene, self._settings, self._made = scene, settings, made
        self._rng = np.random.default_rng(settings.seed)
        self._surface = sample_surface(scene, SURFACE_POINTS, self._rng)
        self._sieve_views = SIEVE_VIEWS * min(1.0, MEASURED_GAUSSIANS / max(1, len(scene)))
        self._spent, self._whole = 0.0, float(settings.views)

    def steps(self, known: Sequence[Camera]) -> Iterator[MapStep]:
        cameras = spread_cameras(known, self._surface)[: self._settings.views]
        searching = len(cameras) < self._settings.views and len(self._surface) > 0
        if searching and self._made.search is None:
            self._whole += self._sieve_views + FIRST_VIEWS
        yield from self._known_views(cameras[len(self._made) :])
        if searching and len(self._made) < self._settings.views:
            if self._made.search is None:
                yield from self._sieved()
            yield from self._chosen()
        yield MapStep(replace(self._made, complete=True), "the map is complete", 1.0)

    def _known_views(self, cameras: Sequence[Camera]) -> Iterator[MapStep]:
        if not cameras:
            return
        eye = Eye(thinned(self._scene, 1.0, self._settings.seed), self._settings.threads)
        for camera in cameras:
            depth = expected_depth(self._surface, camera.pose)
            lens = camera.intrinsics.pinhole().with_long_side(round(KNOWN_SIDE * self._settings.side_px))
            self._add(MapView.of(eye.look(camera.pose, lens, depth), known=True))
            yield self._step("drawing the known cameras' views")

    def _sieved(self) -> Iterator[MapStep]:
        """Candidates from the surface alone."""
        work = sieved(self._surface, self._rng)
        search = yield from converted(work, lambda share: self._step(SEARCH_STEP, share * self._sieve_views))
        self._made = replace(self._made, search=search)
        self._spent += self._sieve_views

    def _chosen(self) -> Iterator[MapStep]:
        """Views of the places that look best, and of others around them."""
        begun, looks = self._made.search, 0
        assert begun is not None
        camera = square_camera(self._settings.side_px)
        scout, eye = self._eyes((square_camera(SCOUT_PX), camera), begun.ratio)
        explorer = Explorer(Scout(scout, self._surface), begun)
        for sight in explorer.choices():
            if sight is None:
                looks += 1
                yield self._step(SEARCH_STEP, LOOK_VIEWS * min(looks, MOST_LOOKS if begun.taken else FIRST_LOOKS))
                continue
            view = MapView.of(eye.look(sight.pose, camera, sight.viewpoint.depth))
            self._spent += 0 if begun.taken else FIRST_VIEWS
            begun, looks = explorer.state(), 0
            self._made = replace(self._made, search=begun)
            self._add(view)
            yield self._step("drawing views")
            if len(self._made) >= self._settings.views:
                return

    def _eyes(self, cameras: Sequence[Intrinsics], ratio: float) -> list[Eye]:
        """An eye for each camera; those that can show all Gaussians share their tables."""
        tables: dict[float, SceneTables] = {}
        for share in (shares := [share_for(camera, ratio) for camera in cameras]):
            if share not in tables:
                tables[share] = build_tables(thinned(self._scene, share, self._settings.seed))
        return [Eye(tables[share], self._settings.threads) for share in shares]

    def _add(self, view: MapView) -> None:
        self._made = replace(self._made, views=(*self._made.views, view))

    def _step(self, what: str, more: float = 0.0) -> MapStep:
        """`more`: what has been done of the next view, or of the search before the first, in views."""
        return MapStep(self._made, what, min(1.0, (self._spent + len(self._made) + more) / self._whole))
