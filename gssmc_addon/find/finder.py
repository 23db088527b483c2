"""The search of photos in one scan, in a job's thread: known cameras first, then a map that grows as far as photos need it.

Nothing here touches Blender.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...core.batch.find_one import RETRIED, not_found_either
from ...core.cameras.training_world import ScanAxes, training_turns
from ...core.geometry.camera import Camera, Pose
from ...core.geometry.conventions import Orientation
from ...core.locate import (
    FindProgress,
    FindReport,
    LandmarkMap,
    MapCache,
    MapPlace,
    MapSettings,
    MapStep,
    MapView,
    PhotoLens,
    build_map,
    iterate_finding,
)
from ...core.locate.known_cameras import cameras_beside
from ...core.pose.report import RefineReport
from ...core.splats.scene import GaussianScene
from ..jobs.worker import RefineInputs, refinement
from ..splat.renderer import SplatRenderer
from ..support.texts import n_

log = logging.getLogger(__name__)

NEAR_STEP = n_("looking from where the camera stands")
KNOWN_STEP = n_("looking from solved cameras")
READING_STEP, PREPARING_STEP, MAP_STEP = n_("reading the photo"), n_("preparing the splat"), n_("searching the map")
BEFORE_MAP = (READING_STEP, PREPARING_STEP, NEAR_STEP, KNOWN_STEP)
KNOWN_MOST = 40  # solved cameras that are looked from, spread evenly over all
FEWEST_LANDMARKS = 8  # of a view: with fewer no camera can be worked out

Where = Literal["", "near", "known", "map"]
Finding = Generator[FindProgress, None, FindReport]


@dataclass(frozen=True)
class MapWanted:
    """What the map is to be, where it is kept, and which way the axes of the splat's file point."""

    settings: MapSettings
    place: MapPlace
    orientation: Orientation = "Y_DOWN"


class GrowingMap:
    """A scan's map: what is kept of it, then as much more as is asked for. One thread at a time."""

    def __init__(self, scene: GaussianScene, wanted: MapWanted) -> None:
        """Reads what is kept."""
        beside, axes = cameras_beside(wanted.place.scan), ScanAxes.of(scene)
        # A copy out of Blender does not know of its file's axes, by which those of the training's cameras may differ.
        axes = replace(axes, turns=training_turns(wanted.orientation), orientation=wanted.orientation)
        known, sentence = axes.settled(beside[1] if beside else (), "auto")
        if sentence:
            log.info("known cameras: %s", sentence)
        self._cache = MapCache(scene, wanted.place, wanted.settings, known)
        self.made = self._cache.read()
        self._kept = len(self.made)
        self._making: Iterator[MapStep] | None = None

    def steps(self) -> Iterator[MapStep]:
        """The map in growing parts, for one photo; its last step is all there is to be had. The next photo's go on from it."""
        whole = self.made
        for size in range(1, len(whole) + 1):
            yield MapStep(LandmarkMap(whole.key, whole.views[:size]), MAP_STEP, float(size == len(whole)))
        while not self.made.complete:
            step = self._next()
            if len(step.map) > len(self.made) or (step.map.complete and step.fraction >= 1):
                self.made = step.map
            yield replace(step, map=self.made)

    def keep(self) -> None:
        """Writes the map where it is more than what is kept already; whether it is whole only its maker knows."""
        if len(self.made) > self._kept:
            self._cache.keep(replace(self.made, complete=False))
            self._kept = len(self.made)

    def _next(self) -> MapStep:
        """The maker's next step, of the one that works for all photos."""
        if self._making is None:
            self._making = self._cache.steps()
        step = next(self._making, None)
        return step or MapStep(replace(self.made, complete=True), MAP_STEP, 1.0)


class Finder:
    """Finds the photos of a job, one after the other, in the scan of one renderer."""

    def __init__(self, splat: SplatRenderer, wanted: MapWanted) -> None:
        """`splat` has to keep its scene."""
        self._splat, self._wanted = splat, wanted
        self._map: GrowingMap | None = None
        self._known: dict[int, Camera] = {}
        self._views: dict[int, MapView] = {}
        self._near, self._nearby = 0, 0  # views before the map: the camera's own, and with those of solved cameras

    @property
    def wanted_views(self) -> int:
        """Views of the whole map."""
        return self._wanted.settings.views

    @property
    def known(self) -> int:
        """How many solved cameras are looked from."""
        return len(self._known)

    @property
    def views_before(self) -> int:
        """Views that the present photo is looked for in before those of the map: its camera's own, and solved cameras'."""
        return self._nearby

    def know(self, uid: int, camera: Camera) -> None:
        """Takes in a solved camera, by the id of its object; any thread, between two photos."""
        self._known[uid] = camera
        self._views.pop(uid, None)

    def finding(self, inputs: RefineInputs, own: int = 0) -> Finding:
        """The whole search of one photo, whose camera's id is `own`. Raises GssmcError for input that cannot be used.

        Whatever ends it, the views that were made are kept.
        """
        yield FindProgress(READING_STEP, 0.0, 0)
        photo = inputs.photo.read()
        camera = inputs.camera.at_size(photo.width, photo.height)
        yield FindProgress(PREPARING_STEP, 0.0, 0)
        renderer, scene = inputs.splat.get(), self._splat.scene
        assert scene is not None, "the renderer was told to keep it"
        guessed = camera.focal_guessed and inputs.settings.lens != "fixed"
        target = PhotoLens(photo, camera.intrinsics, guessed)
        try:
            return (yield from iterate_finding(renderer, target, self._source(scene, camera, own), inputs.settings))
        finally:
            if self._map is not None:
                self._map.keep()

    def found_if_failed(self, inputs: RefineInputs, own: int = 0) -> Generator[object, None, RefineReport]:
        """A refinement from the camera that is there, whose id is `own`; where that fails, the search, whose report counts if
        it is better. The reasons tell of it.
        """
        report: RefineReport = yield from refinement(inputs)
        if report.verdict != "failed":
            return report
        found: FindReport = yield from self.finding(inputs, own)
        seconds, better = report.seconds + found.seconds, as_refined(found)
        if better is None:
            return replace(report, reasons=tuple(not_found_either(report.reasons, found.reasons)), seconds=seconds)
        return replace(better, reasons=(*better.reasons, RETRIED), seconds=seconds)

    def from_where(self, found: FindReport) -> Where:
        """From what the last photo's camera was found; only of a trusted one, with which the search ends, that is known."""
        if found.verdict != "trusted":
            return ""
        if found.views <= self._near:
            return "near"
        return "known" if found.views <= self._nearby else "map"

    def _source(self, scene: GaussianScene, camera: Camera, own: int) -> Iterator[MapStep]:
        """The camera's own view first, then those of solved cameras, then the map behind them."""
        key = "known"
        front = self._front_view(scene, camera)
        self._near = self._nearby = len(front)
        yield MapStep(LandmarkMap(key, front), NEAR_STEP, 1.0)
        known = {uid: other for uid, other in self._known.items() if uid != own}
        if known:
            front += self._known_views(scene, known)
            self._nearby = len(front)
            yield MapStep(LandmarkMap(key, front), KNOWN_STEP, 1.0)
        if self._map is None:
            self._map = GrowingMap(scene, self._wanted)
        for step in self._map.steps():
            yield replace(step, map=replace(step.map, views=front + step.map.views))

    def _front_view(self, scene: GaussianScene, camera: Camera) -> tuple[MapView, ...]:
        return tuple(view for view in self._drawn(scene, [camera]) if len(view) >= FEWEST_LANDMARKS)

    def _known_views(self, scene: GaussianScene, known: dict[int, Camera]) -> tuple[MapView, ...]:
        uids = list(known)[:: max(1, -(-len(known) // KNOWN_MOST))]
        new = [uid for uid in uids if uid not in self._views]
        for view in self._drawn(scene, [known[uid] for uid in new]):
            uid = next(uid for uid in new if _is_same(known[uid].pose, view.pose))
            self._views[uid] = view
        return tuple(self._views[uid] for uid in uids if uid in self._views and len(self._views[uid]) >= FEWEST_LANDMARKS)

    def _drawn(self, scene: GaussianScene, cameras: list[Camera]) -> tuple[MapView, ...]:
        """Views of these cameras alone, in any order."""
        if not cameras:
            return ()
        settings = replace(self._wanted.settings, views=len(cameras))
        return list(build_map(scene, settings, cameras, "known"))[-1].map.views


def as_refined(found: FindReport) -> RefineReport | None:
    """The report of the refinement that a search ended with, its time that of the whole; None where no camera was found."""
    if found.refined is None or found.verdict == "failed":
        return None
    return replace(found.refined, seconds=found.seconds)


def known_of(cameras: Iterable[tuple[int, Camera]], finder: Finder) -> Finder:
    """The finder, which knows these solved cameras."""
    for uid, camera in cameras:
        finder.know(uid, camera)
    return finder


def _is_same(a: Pose, b: Pose) -> bool:
    return np.array_equal(a.R, b.R) and np.array_equal(a.t, b.t)
