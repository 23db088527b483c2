"""Find Camera: the whole way from a photo without a start to a verdict.

The map grows, or is there already; at certain sizes the photo is tried; what the renders confirm is refined, and the
refinement's own verdict decides. The first trusted camera ends the search.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace

from ..geometry.camera import Camera
from ..pose.refine import iterate_refinement
from ..pose.report import RefineProgress, RefineReport, Verdict
from ..pose.settings import RefineSettings
from ..pose.verdict.sentences import without_start
from ..render.view import ViewRenderer
from ..support.steps import converted, run_to_end
from .build import MapStep
from .hypotheses import Hypothesis
from .landmarks import LandmarkMap
from .locate import FIRST_STAGE, Locator, PhotoLens

RIVALS = (
    "The photo fits other places of the scan as well, which look the same; look whether the camera stands at the right one."
)
REFINEMENTS = 4  # of one photo at most: each costs as much as the rest together
RANK: dict[Verdict, int] = {"trusted": 2, "check": 1, "failed": 0}


@dataclass(frozen=True)
class FindProgress:
    """One step of the work. `views` of the map so far; `refining` is set while a hypothesis is refined."""

    step: str
    fraction: float
    views: int
    refining: RefineProgress | None = None


@dataclass(frozen=True)
class FindReport:
    """The end of a search. `camera` is None when the verdict is "failed"; `reasons` are whole sentences; `hypothesis` is what
    the refinement started from; `refined` its own report; `views` of the map were tried; `seconds` is wall time.
    """

    camera: Camera | None
    verdict: Verdict
    reasons: tuple[str, ...]
    hypothesis: Hypothesis | None
    refined: RefineReport | None
    views: int
    seconds: float


Finding = Generator[FindProgress, None, FindReport]


def find_camera(
    renderer: ViewRenderer,
    target: PhotoLens,
    source: LandmarkMap | Iterable[MapStep],
    settings: RefineSettings | None = None,
    on_progress: Callable[[FindProgress], None] | None = None,
) -> FindReport:
    """Runs `iterate_finding` to its end. `on_progress` may raise (for example Cancelled) to stop it."""
    return run_to_end(iterate_finding(renderer, target, source, settings or RefineSettings()), on_progress)


def iterate_finding(
    renderer: ViewRenderer, target: PhotoLens, source: LandmarkMap | Iterable[MapStep], settings: RefineSettings
) -> Finding:
    """The search as a generator. `source` is a finished map, or `build_map` at work, which is asked for no more views than the
    photo needs. Closing the generator cancels; nothing outside it is touched.
    """
    job = _Job(renderer, target, settings)
    if job.locator.blind:
        return job.report(0)
    for step in _steps(source):
        yield FindProgress(step.step, step.fraction, len(step.map))
        if job.due(step):
            yield from job.tried(step.map)
            if job.done:
                break
    return job.report(job.locator.views)


def _steps(source: LandmarkMap | Iterable[MapStep]) -> Iterator[MapStep]:
    """The map's growth; a finished map is walked through by the same prefixes, so that a larger one finds no less."""
    if not isinstance(source, LandmarkMap):
        yield from source
        return
    for size in (*range(1, len(source)), len(source)):
        part = source if size == len(source) else LandmarkMap(source.key, source.views[:size])
        yield MapStep(part, "searching the map", 0.5 * size / max(1, len(source)))


class _Job:
    """One photo's search: what was refined, and the best of it."""

    def __init__(self, renderer: ViewRenderer, target: PhotoLens, settings: RefineSettings) -> None:
        self._began = time.perf_counter()
        self._renderer, self._target, self._settings = renderer, target, settings
        self.locator = Locator(renderer, target)
        self._next = FIRST_STAGE
        self._left = REFINEMENTS
        self._best: tuple[RefineReport, Hypothesis] | None = None

    @property
    def done(self) -> bool:
        """Whether the search ends: a camera is trusted; or one is to be checked and came from a clear hypothesis, because more
        views would only lead to the same place again; or as many were refined as may be.
        """
        if self._best is None or self._left == 0:
            return self._left == 0
        report, start = self._best
        return report.verdict == "trusted" or (report.verdict == "check" and start.clear)

    def due(self, step: MapStep) -> bool:
        """Whether the photo is to be tried on this step's map."""
        return len(step.map) > self.locator.views and (len(step.map) >= self._next or step.fraction >= 1 or step.map.complete)

    def tried(self, landmarks: LandmarkMap) -> Generator[FindProgress, None, None]:
        """Matches the views that are new, and refines what they give."""
        while self._next <= len(landmarks):
            self._next *= 2
        located = self.locator.located()
        for one in self.locator.extend(landmarks.views[self.locator.views :]):
            if self.done:
                return
            if self._settled(one):
                continue
            self._left -= 1
            start = located.camera(one, self._target.photo.file)
            work = iterate_refinement(self._renderer, self._target.photo, start, self._settings)
            report = yield from converted(work, lambda p: FindProgress("refining", 0.5 + 0.5 * p.fraction, len(landmarks), p))
            if report.verdict != "failed" and self.locator.rivals(one):
                report = replace(report, verdict="check", reasons=(RIVALS, *report.reasons))
            self._keep(report, one)

    def _settled(self, one: Hypothesis) -> bool:
        """Whether this place has a camera already: a better hypothesis of it would be refined to the same one."""
        return self._best is not None and self._best[0].verdict != "failed" and one.same_as(self._best[1])

    def _keep(self, report: RefineReport, start: Hypothesis) -> None:
        """Remembers the better of two: by the verdict, then by how well the render agrees with the photo."""
        if self._best is None or _merit(report) > _merit(self._best[0]):
            self._best = report, start

    def report(self, views: int) -> FindReport:
        seconds = time.perf_counter() - self._began
        if self._best is None:
            return FindReport(None, "failed", (self.locator.located().reason,), None, None, views, seconds)
        found, start = self._best
        found = replace(found, reasons=tuple(without_start(reason) for reason in found.reasons))
        camera = None if found.verdict == "failed" else found.camera
        return FindReport(camera, found.verdict, found.reasons, start, found, views, seconds)


def _merit(report: RefineReport) -> tuple[int, float]:
    return RANK[report.verdict], report.quality.agreement if report.quality else 0.0
