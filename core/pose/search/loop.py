"""The iterations: render a fan of views around the pose, match, solve, and again until the answer lies inside the fan."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...features.frontend import Frontend
from ...features.matchers.nearest import MutualNearest
from ...geometry.camera import Intrinsics, Pose, pose_error
from ...render.view import ViewRenderer, sole_renderer
from ...support.words import counted
from ..final.stage import view_pool
from ..report import IterationRecord, RefineProgress
from ..settings import RefineSettings
from ..shared.matches import ViewMatches
from ..verdict.verify import FinalView, compare
from .epipolar import EpipolarFit, measure_epipolar
from .focal import refocus
from .hypotheses import GAUSSIAN_LENGTH, candidate_poses
from .observe import Observation, PhotoFeatures, observe
from .solve import UsableView, coarse_pose, fine_matches, fine_pose, keep_distance, usable_views

# A reference view that shows less of the scan than this share of its pixels looks away from it.
MIN_OPAQUE = 0.02
LOOKS_AWAY = "The start camera sees almost nothing of the splat; turn it towards the scene and refine again."
TOO_FEW = (
    "Too few matches between the photo and the splat: the photo may show another place, or the start is too far off; "
    "move the camera closer to the photo's view and refine again."
)
WIDEN = 3.0
# A share of the median depth; candidates farther away would leave the place that is photographed.
MAX_SPREAD = 0.3
MAX_SPREAD_DEG = 20.0
# Candidates of a search turn by at least this much, because one that keeps looking the same way finds nothing new.
MIN_SEARCH_DEG = 3.0
# The limit of the ratio test while searching: it lets more matches through, and the geometry sorts out the wrong ones.
SEARCH_RATIO = 0.9
# A wide fan gets so many times the candidates of a narrow one, because few of them look the photo's way.
SEARCH_CANDIDATES = 2
# An answer that is turned by less than this against the rendered views matches them as well as it ever will.
INSIDE_FAN_DEG = 6.0
# The share of the whole progress that the loop takes.
LOOP_SHARE = 0.7


@dataclass(frozen=True)
class Answer:
    """A pose of one iteration with what it was found from, and the intrinsics (of the working photo) it holds for."""

    fit: EpipolarFit
    views: tuple[ViewMatches, ...]
    median_depth: float
    intrinsics: Intrinsics


@dataclass(frozen=True)
class LoopResult:
    """What all iterations came to: an answer, or one sentence that says what was missing (`problem`), with its figures in
    `details`.

    `start`: how the splat sat on the photo at the start camera; `start_depth`: the median depth there, scene units.
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
class IterationStart:
    """What an iteration begins with: its number from 0 in the whole refinement, the photo, the lens as it was given, the pose
    that the reference view is drawn at, and whether no earlier iteration of this run had an answer.
    """

    index: int
    photo: PhotoFeatures
    prior: Intrinsics
    pose: Pose
    first: bool


@dataclass(frozen=True)
class IterationEnd:
    """What an iteration came to: the photo (its lens may have changed), the answer if there is one, and the record.
    `refocused`: there is a pose but no fit of it, because the focal length changed by more than renders and photo can be
    aligned across.
    """

    photo: PhotoFeatures
    answer: Answer | None
    record: IterationRecord
    refocused: bool = False


@dataclass(frozen=True)
class Loop:
    """One refinement's fixed inputs; `run` does the iterations. `solves_focal`: the focal length is unknown; `extract`: the
    photo with the features that a frontend finds in it; `wide`: whether the first fan is a wide one.
    """

    renderer: ViewRenderer
    settings: RefineSettings
    frontend: Frontend
    solves_focal: bool
    extract: Callable[[Frontend], PhotoFeatures]
    wide: bool = False

    def stronger(self, photo: PhotoFeatures, usable: int, views: int) -> tuple[Loop, PhotoFeatures]:
        """The loop and the photo with the kind of features that takes over where `usable` of `views` views gave no answer; the
        same ones if there is no such kind.
        """
        frontend = self.frontend.stronger(usable, views)
        if frontend is None:
            return self, photo
        return replace(self, frontend=frontend), self.extract(frontend).with_intrinsics(photo.image.intrinsics)

    def run(
        self, photo: PhotoFeatures, start: Pose, records: list[IterationRecord], rng: np.random.Generator
    ) -> Generator[RefineProgress, None, LoopResult]:
        """Iterates from `start` and returns the best answer; appends to `records`."""
        settings, prior = self.settings, photo.image.intrinsics
        narrow = Fan(settings.perturb_translation_ratio, settings.perturb_rotation_deg)
        fan = narrow.wider() if self.wide else narrow
        pose, best, loop, out = start, None, self, LoopResult(None)
        for index in range(settings.iterations):
            observations = yield from loop._observe(photo, pose, fan, index, rng)
            if not observations:
                return replace(out, answer=best, problem=LOOKS_AWAY, details=())
            reference = observations[0]
            if index == 0:
                at_start = compare(photo.image, reference.grey, reference.solid)
                out = replace(out, start=at_start, start_depth=reference.median_depth)
            end = loop._solve(IterationStart(len(records), photo, prior, pose, first=best is None), observations)
            records.append(end.record)
            yield self._progress(index + 1, "iteration done", index + 1, end.record)
            photo, answer = end.photo, end.answer
            if answer is None:
                out = replace(out, problem=TOO_FEW, details=(_figures(observations, end.record),))
                fan, pose = (narrow if end.refocused else fan.wider()), end.record.pose
                loop, photo = loop.stronger(photo, end.record.views_used, len(observations))
                continue
            if best is not None and not _supports(answer, best):
                break  # Fewer matches agree than before: a later iteration must not spoil a good pose.
            best, pose, moved_from = answer, answer.fit.pose, pose
            if settings.multiview and fan == narrow and _inside_fan(answer, moved_from, self._sigma(fan, answer.median_depth)):
                break
            fan = narrow
        return replace(out, answer=best)

    def _progress(self, iteration: int, step: str, done: float, record: IterationRecord | None = None) -> RefineProgress:
        return RefineProgress(iteration, self.settings.iterations, step, LOOP_SHARE * done / self.settings.iterations, record)

    def _observe(
        self, photo: PhotoFeatures, pose: Pose, fan: Fan, index: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, list[Observation]]:
        """Renders and matches the reference and its candidates; empty when the reference sees nothing of the scan."""
        narrow = fan.ratio <= self.settings.perturb_translation_ratio
        frontend = self.frontend if narrow else searching(self.frontend)
        count = self.settings.candidates * (1 if narrow else SEARCH_CANDIDATES) if self.settings.multiview else 0
        yield self._progress(index + 1, "rendering the reference view", index)
        reference = observe(sole_renderer(self.renderer), photo, pose, True, frontend)
        if reference.opaque < MIN_OPAQUE:
            return []
        poses = candidate_poses(pose, count, self._sigma(fan, reference.median_depth), fan.rotation_deg, rng)
        out = [reference]
        with view_pool(self.settings.threads) as pool:
            views = [pool.submit(observe, self.renderer, photo, p, False, frontend) for p in poses]
            for k, view in enumerate(views):
                yield self._progress(index + 1, f"view {k + 2} of {count + 1}", index + (k + 1) / (count + 1))
                out.append(view.result())
        return out

    def _sigma(self, fan: Fan, median_depth: float) -> float:
        """Deviation of the candidates' centres in scene units; a fan that was widened widens a deviation in units alike."""
        return self.settings.perturb_translation(median_depth) * (fan.ratio / self.settings.perturb_translation_ratio)

    def _solve(self, start: IterationStart, observations: list[Observation]) -> IterationEnd:
        """The focal length where it is unknown, then the coarse and the fine stage on one iteration's views."""
        photo, settled = start.photo, True
        if self.solves_focal:
            refocused = refocus(photo, observations, start.prior, start.first)
            photo, observations, settled = refocused.photo, refocused.observations, refocused.settled
        K = photo.pinhole.matrix
        matches = sum(len(o.matches) for o in observations)
        usable = usable_views(observations, photo.pinhole.focal)
        record = partial(IterationRecord, start.index, len(usable), matches)
        coarse = coarse_pose(observations, usable, K, self.settings.multiview)
        if coarse is None:
            return IterationEnd(photo, None, record(0, float("nan"), start.pose))
        if not settled:  # Photo and renders differ in scale; the renders of the next iteration will not.
            inliers = sum(u.support for u in usable)
            return IterationEnd(photo, None, record(inliers, float("nan"), coarse), refocused=True)
        fit, views = self._fit(photo, coarse, observations, usable)
        inliers = sum(len(v) for v in views)
        if fit is None:
            return IterationEnd(photo, None, record(inliers, float("nan"), coarse))
        answer = Answer(fit, tuple(views), observations[0].median_depth, photo.image.intrinsics)
        return IterationEnd(photo, answer, record(inliers, photo.image.photo_px * fit.rms_px, fit.pose))

    def _fit(
        self, photo: PhotoFeatures, coarse: Pose, observations: Sequence[Observation], usable: Sequence[UsableView]
    ) -> tuple[EpipolarFit | None, list[ViewMatches]]:
        """The fine stage from the coarse pose, or, where it is switched off, the coarse pose measured."""
        K = photo.pinhole.matrix
        if not self.settings.epipolar:
            views = [u.inliers for u in usable]
            return (measure_epipolar(coarse, views, K) if views else None), views
        views = fine_matches(coarse, observations, photo, self.frontend)
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
        f"The photo has {counted(record.matches, 'match', 'matches')} with {counted(len(observations), 'rendered view')}, of "
        f"which {counted(record.views_used, 'view')} {'holds' if record.views_used == 1 else 'hold'} a pose."
    )


def _supports(answer: Answer, best: Answer) -> bool:
    """Whether about as many matches as before, or more, agree with the new answer."""
    return sum(map(len, answer.views)) >= 0.7 * sum(map(len, best.views))


def _inside_fan(answer: Answer, reference: Pose, sigma: float) -> bool:
    """Whether the rendered views surround the answer, so that another iteration would see the same again."""
    distance, degrees = pose_error(answer.fit.pose, reference)
    return distance <= GAUSSIAN_LENGTH * sigma and degrees <= INSIDE_FAN_DEG
