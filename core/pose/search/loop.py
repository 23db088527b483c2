"""The iterations: render a fan of views around the pose, match, solve, and again until the answer lies inside the fan."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...features.frontend import Frontend
from ...features.matchers.nearest import MutualNearest
from ...geometry.camera import Intrinsics, Pose, pose_error
from ...render.view import ViewRenderer, alone
from ..final.stage import view_pool
from ..report import IterationRecord, RefineProgress
from ..settings import RefineSettings
from ..shared.lens import LensMode
from ..shared.matches import ViewMatches
from ..verdict.verify import FinalView, compare
from .epipolar import EpipolarFit, measure_epipolar
from .focal import refocus
from .hypotheses import GAUSSIAN_LENGTH, candidate_poses
from .observe import Observation, Query, observe
from .solve import UsableView, coarse_pose, fine_matches, fine_pose, keep_distance, usable_views

MIN_OPAQUE = 0.02  # a reference view with less of the scan in it looks away from it
LOOKS_AWAY = "The start camera sees almost nothing of the splat; turn it towards the scene and refine again."
TOO_FEW = (
    "Too few matches between the photo and the splat: the photo may show another place, or the start is too far off; "
    "move the camera closer to the photo's view and refine again."
)
WIDEN = 3.0
MAX_SPREAD = 0.3  # of the median depth; beyond, the candidates leave the place
MAX_SPREAD_DEG = 20.0
MIN_SEARCH_DEG = 3.0  # a search that keeps looking the same way finds nothing new
SEARCH_RATIO = 0.9  # of the ratio test while searching: more matches, more of them wrong, which the geometry sorts out
SEARCH_CANDIDATES = 2  # times the candidates of a narrow fan: in a wide one few look the photo's way
INSIDE_FAN_DEG = 6.0  # an answer turned less than this from the views matches them as well as it ever will
LOOP_SHARE = 0.7  # of the whole progress


@dataclass(frozen=True)
class Answer:
    """A pose of one iteration with what it was found from, and the intrinsics (of the working photo) it holds for."""

    fit: EpipolarFit
    views: tuple[ViewMatches, ...]
    median_depth: float
    intrinsics: Intrinsics


@dataclass(frozen=True)
class Outcome:
    """What the iterations came to: an answer, or one sentence that says what was missing, with the figures of it in `details`.

    `start`: how the splat sat on the photo at the start camera, `start_depth` the median depth there, scene units.
    """

    answer: Answer | None
    problem: str = ""
    details: tuple[str, ...] = ()
    start: FinalView | None = None
    start_depth: float = float("nan")


@dataclass(frozen=True)
class Fan:
    """Spread of the candidates: `ratio` of the median depth, and degrees."""

    ratio: float
    rotation_deg: float

    def wider(self) -> Fan:
        return Fan(min(self.ratio * WIDEN, MAX_SPREAD), min(max(self.rotation_deg, MIN_SEARCH_DEG) * WIDEN, MAX_SPREAD_DEG))


@dataclass(frozen=True)
class Step:
    """The end of one iteration: the query (its lens may have changed), the answer if there is one, and the record. `refocused`:
    there is a pose but no fit of it, because the focal length changed by more than renders and photo can be aligned across.
    """

    query: Query
    found: Answer | None
    record: IterationRecord
    refocused: bool = False


@dataclass(frozen=True)
class Loop:
    """One refinement's fixed inputs; `run` does the iterations. `lens`: what of the lens is unknown; `look` makes the query
    that a frontend sees in the photo.
    """

    renderer: ViewRenderer
    settings: RefineSettings
    frontend: Frontend
    lens: LensMode
    look: Callable[[Frontend], Query]

    def stronger(self, query: Query, usable: int, views: int) -> tuple[Loop, Query]:
        """The loop and query with the features that should look on where these found no answer; the same if there are none."""
        frontend = self.frontend.stronger(usable, views)
        if frontend is None:
            return self, query
        return replace(self, frontend=frontend), self.look(frontend).with_intrinsics(query.image.intrinsics)

    def run(
        self, query: Query, start: Pose, records: list[IterationRecord], rng: np.random.Generator
    ) -> Generator[RefineProgress, None, Outcome]:
        """Iterates from `start` and returns the best answer; appends to `records`."""
        settings, prior = self.settings, query.image.intrinsics
        fan = narrow = Fan(settings.perturb_translation_ratio, settings.perturb_rotation_deg)
        pose, best, loop, out = start, None, self, Outcome(None)
        for index in range(settings.iterations):
            observations = yield from loop._observe(query, pose, fan, index, rng)
            if not observations:
                return replace(out, answer=best, problem=LOOKS_AWAY, details=())
            reference = observations[0]
            if index == 0:
                seen = compare(query.image, reference.grey, reference.solid)
                out = replace(out, start=seen, start_depth=reference.median_depth)
            step = loop._solve(query, prior, observations, pose, index, first=best is None)
            records.append(step.record)
            yield self._progress(index + 1, "iteration done", index + 1, step.record)
            query, found = step.query, step.found
            if found is None:
                out = replace(out, problem=TOO_FEW, details=(_figures(observations, step.record),))
                fan, pose = (narrow if step.refocused else fan.wider()), step.record.pose
                loop, query = loop.stronger(query, step.record.views_used, len(observations))
                continue
            if best is not None and not _supports(found, best):
                break  # fewer matches agree than before: a later iteration must not spoil a good pose
            best, pose, moved_from = found, found.fit.pose, pose
            if settings.multiview and fan == narrow and _inside_fan(found, moved_from, self._sigma(fan, found.median_depth)):
                break
            fan = narrow
        return replace(out, answer=best)

    def _progress(self, iteration: int, step: str, done: float, record: IterationRecord | None = None) -> RefineProgress:
        return RefineProgress(iteration, self.settings.iterations, step, LOOP_SHARE * done / self.settings.iterations, record)

    def _observe(
        self, query: Query, pose: Pose, fan: Fan, index: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, list[Observation]]:
        """Renders and matches the reference and its candidates; empty when the reference sees nothing of the scan."""
        narrow = fan.ratio <= self.settings.perturb_translation_ratio
        frontend = self.frontend if narrow else searching(self.frontend)
        count = self.settings.candidates * (1 if narrow else SEARCH_CANDIDATES) if self.settings.multiview else 0
        yield self._progress(index + 1, "rendering the reference view", index)
        reference = observe(alone(self.renderer), query, pose, True, frontend)
        if reference.opaque < MIN_OPAQUE:
            return []
        poses = candidate_poses(pose, count, self._sigma(fan, reference.median_depth), fan.rotation_deg, rng)
        out = [reference]
        with view_pool(self.settings.threads) as pool:
            jobs = [pool.submit(observe, self.renderer, query, p, False, frontend) for p in poses]
            for k, job in enumerate(jobs):
                yield self._progress(index + 1, f"view {k + 2} of {count + 1}", index + (k + 1) / (count + 1))
                out.append(job.result())
        return out

    def _sigma(self, fan: Fan, median_depth: float) -> float:
        """Deviation of the candidates' centres in scene units; a fan that was widened widens a deviation in units alike."""
        return self.settings.perturb_translation(median_depth) * (fan.ratio / self.settings.perturb_translation_ratio)

    def _solve(
        self, query: Query, prior: Intrinsics, observations: list[Observation], pose: Pose, index: int, first: bool
    ) -> Step:
        """The focal length where it is unknown, then the coarse and the fine stage on one iteration's views."""
        settled = True
        if self.lens != "fixed":
            focused = refocus(query, observations, prior, first)
            query, observations, settled = focused.query, focused.observations, focused.settled
        K = query.pinhole.matrix
        matches = sum(len(o.matches) for o in observations)
        usable = usable_views(observations, query.pinhole.focal)
        coarse = coarse_pose(observations, usable, K, self.settings.multiview)
        if coarse is None:
            return Step(query, None, IterationRecord(index, len(usable), matches, 0, float("nan"), pose))
        if not settled:  # photo and renders differ in scale: the next iteration's renders will not
            held = sum(u.support for u in usable)
            return Step(query, None, IterationRecord(index, len(usable), matches, held, float("nan"), coarse), refocused=True)
        fit, views = self._fit(query, coarse, observations, usable)
        inliers = sum(len(v) for v in views)
        if fit is None:
            return Step(query, None, IterationRecord(index, len(usable), matches, inliers, float("nan"), coarse))
        record = IterationRecord(index, len(usable), matches, inliers, query.image.photo_px * fit.rms_px, fit.pose)
        return Step(query, Answer(fit, tuple(views), observations[0].median_depth, query.image.intrinsics), record)

    def _fit(
        self, query: Query, coarse: Pose, observations: Sequence[Observation], usable: Sequence[UsableView]
    ) -> tuple[EpipolarFit | None, list[ViewMatches]]:
        """The fine stage from the coarse pose, or, where it is switched off, the coarse pose measured."""
        K = query.pinhole.matrix
        if not self.settings.epipolar:
            views = [u.inliers for u in usable]
            return (measure_epipolar(coarse, views, K) if views else None), views
        views = fine_matches(coarse, observations, query, self.frontend)
        fit = fine_pose(coarse, views, K) if views else None
        if fit is not None and len(views) == 1:
            fit = keep_distance(fit, coarse, views[0], K)
        return fit, views


def searching(frontend: Frontend) -> Frontend:
    """The frontend of a search: a laxer ratio test, because any right match is worth ten wrong ones there."""
    if isinstance(frontend.matcher, MutualNearest):
        return replace(frontend, matcher=MutualNearest(max(SEARCH_RATIO, frontend.matcher.ratio)))
    return frontend


def _figures(observations: Sequence[Observation], record: IterationRecord) -> str:
    return (
        f"The photo has {record.matches} matches with {len(observations)} rendered views, and {record.views_used} of the views "
        "hold a pose."
    )


def _supports(found: Answer, best: Answer) -> bool:
    """Whether the new answer is held by about as many matches as the one before, or more."""
    return sum(map(len, found.views)) >= 0.7 * sum(map(len, best.views))


def _inside_fan(found: Answer, reference: Pose, sigma: float) -> bool:
    """Whether the rendered views surround the answer, so that another iteration would see the same again."""
    distance, degrees = pose_error(found.fit.pose, reference)
    return distance <= GAUSSIAN_LENGTH * sigma and degrees <= INSIDE_FAN_DEG
