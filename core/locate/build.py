"""Making the map, view by view; whoever stops has a smaller map that is as valid."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.camera import Camera
from ..splats.scene import GaussianScene
from .file import map_key, scan_digest
from .landmarks import LandmarkMap, MapView
from .settings import MapSettings
from .viewpoints.candidates import MOST_FILLED, SOME_FILLED, Candidate, candidate_views, measured_ratio, spread_out
from .viewpoints.explore import Scout, chosen
from .viewpoints.eye import Eye, square_camera
from .viewpoints.known import expected_depth, spread_cameras
from .viewpoints.surface import Surface, sample_surface

log = logging.getLogger(__name__)

SURFACE_POINTS = 20_000
POSITIONS, RATIO_POSITIONS = 400, 24
FEWEST_CANDIDATES = 100
RATIO_SPREAD = (0.7, 1.0, 1.4)  # of the measured ratio of distance and width: photographs were taken from near and far
LOOKS_PER_VIEW = (1, 1)  # candidates looked at for each view of the map: of the sieve's, and around views that were chosen
KNOWN_SIDE = 1.25  # of a view's side: known cameras see what photos see, so that finer renders pay
SIEVE_SHARE, STEP_POSITIONS = 0.1, 25  # of the whole progress; positions between two steps


@dataclass(frozen=True)
class MapStep:
    """One step of the making: the map so far, what was done, and the `fraction` 0..1 of the whole."""

    map: LandmarkMap
    step: str
    fraction: float


def build_map(
    scene: GaussianScene, settings: MapSettings | None = None, known: Sequence[Camera] = (), key: str = ""
) -> Iterator[MapStep]:
    """The map in steps, each with all views so far; stopping the iteration leaves the last step's map.

    `known` cameras (poses in the splat file's coordinates) become views first of all, spread out. `key` as `file.map_key`
    gives it saves reading the scan once more.
    """
    settings = settings or MapSettings()
    made = LandmarkMap(key or map_key(scan_digest(scene), settings, known))
    yield MapStep(made, "reading the scan's surface", 0.0)
    rng = np.random.default_rng(settings.seed)
    surface, eye = sample_surface(scene, SURFACE_POINTS, rng), Eye(scene, settings.threads)
    for camera in spread_cameras(known, surface)[: settings.views]:
        depth = expected_depth(surface, camera.pose)
        lens = camera.intrinsics.pinhole().with_long_side(round(KNOWN_SIDE * settings.side_px))
        made = _with(made, MapView.of(eye.look(camera.pose, lens, depth), known=True))
        yield MapStep(made, "drawing the known cameras' views", len(made) / settings.views)
    if len(made) < settings.views and len(surface):
        candidates: list[Candidate] = []
        for index, some in enumerate(_sieved(surface, rng)):
            candidates += some
            if index % STEP_POSITIONS == 0:
                yield MapStep(
                    made, "looking for viewpoints", (len(made) + min(1.0, index / POSITIONS) * SIEVE_SHARE) / settings.views
                )
        views = (candidate.viewpoint for candidate in spread_out(candidates))
        for sight in chosen(Scout(eye, surface), views, LOOKS_PER_VIEW, rng):
            look = eye.look(sight.pose, square_camera(settings.side_px), sight.depth)
            made = _with(made, MapView.of(look))
            yield MapStep(made, "drawing views", len(made) / settings.views)
            if len(made) >= settings.views:
                break
    yield MapStep(replace(made, complete=True), "the map is complete", 1.0)


def _sieved(surface: Surface, rng: np.random.Generator) -> Iterator[list[Candidate]]:
    """Candidates, those of one position at a time; where hardly a view is filled, those that are less so follow."""
    for filled in (MOST_FILLED, SOME_FILLED):
        ratio, count = measured_ratio(surface, RATIO_POSITIONS, rng, filled), 0
        log.info("surfaces are taken to have been photographed from %.0f times their Gaussians' width", ratio)
        for some in candidate_views(surface, tuple(ratio * spread for spread in RATIO_SPREAD), POSITIONS, rng, filled):
            count += len(some)
            yield some
        if count >= FEWEST_CANDIDATES:
            return


def _with(made: LandmarkMap, view: MapView) -> LandmarkMap:
    return replace(made, views=(*made.views, view))
