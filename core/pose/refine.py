"""The refinement loop: from a rough camera to the photo's own camera, one record per iteration."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..camera import Camera, Pose, pose_error
from ..features.frontend import Frontend, make_frontend
from ..photo import Photo
from ..render.view import ViewRenderer
from .epipolar import EpipolarFit, measure_epipolar
from .hypotheses import GAUSSIAN_LENGTH, candidate_poses
from .matches import ViewMatches
from .observe import Observation, Query, make_query, observe
from .report import IterationRecord, PoseQuality, RefineProgress, RefineReport, Verdict
from .settings import RefineSettings
from .solve import coarse_pose, fine_matches, fine_pose, keep_distance, usable_views
from .verdict import assess, judge
from .verify import compare, view_at

log = logging.getLogger(__name__)

Progress = Generator[RefineProgress, None, "RefineReport"]

MIN_PHOTO_FEATURES = 30
MIN_OPAQUE = 0.02  # a reference view with less of the scan in it looks away from it
LOOKS_AWAY = "The start camera sees almost nothing of the splat; turn it towards the scene and refine again."
WORSE_AGREEMENT = 0.05  # share of corners by which a refined camera may fit worse than its start before the start is kept
WIDEN = 3.0
MAX_SPREAD = 0.3  # of the median depth; beyond, the candidates leave the place
MAX_SPREAD_DEG = 20.0
MIN_SEARCH_DEG = 3.0  # a search that keeps looking the same way finds nothing new
INSIDE_FAN_DEG = 6.0  # an answer turned less than this from the views matches them as well as it ever will


@dataclass(frozen=True)
class Answer:
    """A pose of one iteration with what it was found from."""

    fit: EpipolarFit
    views: tuple[ViewMatches, ...]
    median_depth: float


@dataclass(frozen=True)
class Outcome:
    """What the iterations came to: an answer, or one sentence that says what was missing. `start_agreement` is the share of
    the photo's corners that already sat on the render at the start.
    """

    answer: Answer | None
    problem: str
    start_agreement: float


@dataclass(frozen=True)
class Fan:
    """Spread of the candidates: `ratio` of the median depth, and degrees."""

    ratio: float
    rotation_deg: float

    def wider(self) -> Fan:
        return Fan(min(self.ratio * WIDEN, MAX_SPREAD), min(max(self.rotation_deg, MIN_SEARCH_DEG) * WIDEN, MAX_SPREAD_DEG))


def refine(
    renderer: ViewRenderer,
    photo: Photo,
    camera: Camera,
    settings: RefineSettings | None = None,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Runs `iterate_refinement` to its end. `on_progress` may raise (for example Cancelled) to stop it."""
    work = iterate_refinement(renderer, photo, camera, settings or RefineSettings())
    try:
        while True:
            try:
                progress = next(work)
            except StopIteration as end:
                report: RefineReport = end.value
                return report
            if on_progress is not None:
                on_progress(progress)
    finally:
        work.close()


def iterate_refinement(renderer: ViewRenderer, photo: Photo, camera: Camera, settings: RefineSettings) -> Progress:
    """The loop as a generator: yields a `RefineProgress` after every rendered view and returns the `RefineReport`.

    `camera` is the start: its intrinsics belong to the photo at its full size (see `photo.check_size`), its pose is
    world-to-camera in the splat file's coordinates. Closing the generator cancels; nothing outside it is touched.
    """
    with make_frontend(settings) as frontend:
        return (yield from _refine_with(frontend, renderer, photo, camera, settings))


def _refine_with(
    frontend: Frontend, renderer: ViewRenderer, photo: Photo, camera: Camera, settings: RefineSettings
) -> Progress:
    began = time.perf_counter()
    look = partial(make_query, photo, camera.intrinsics, settings.long_side_px)
    loop = _Loop(renderer, look(frontend), settings, frontend, look)
    if len(loop.query.features) < MIN_PHOTO_FEATURES:
        loop = loop.stronger(0, 1)
    query = loop.query
    records: list[IterationRecord] = []
    if len(query.features) < MIN_PHOTO_FEATURES:
        reason = f"The photo shows only {len(query.features)} features; it is too dark, blurred or plain to be placed."
        return _report(camera, None, "failed", (reason,), records, began)
    outcome = yield from loop.run(camera.pose, records)
    answer = outcome.answer
    if answer is None:
        return _report(camera, None, "failed", (outcome.problem,), records, began)
    yield RefineProgress(len(records), settings.iterations, "checking the answer", 0.97)
    seen = view_at(renderer, query, answer.fit.pose)
    quality = assess(answer.fit, answer.views, seen, query.pinhole, answer.median_depth)
    verdict, reasons = judge(quality)
    before = outcome.start_agreement
    if verdict != "failed" and before > seen.agreement + WORSE_AGREEMENT:
        kept = (
            f"The start camera fits the photo better ({100 * before:.0f} % of the corners against {100 * seen.agreement:.0f} %)"
        )
        return _report(camera, None, "check", (kept + " and was kept.",), records, began, quality)
    refined = None if verdict == "failed" else replace(camera, pose=answer.fit.pose)
    return _report(camera, refined, verdict, reasons, records, began, quality)


def _report(
    start: Camera,
    refined: Camera | None,
    verdict: Verdict,
    reasons: tuple[str, ...],
    records: Sequence[IterationRecord],
    began: float,
    quality: PoseQuality | None = None,
) -> RefineReport:
    seconds = time.perf_counter() - began
    log.info("%s after %d iterations, %.1f s: %s", verdict, len(records), seconds, " ".join(reasons))
    return RefineReport(refined or start, start, verdict, reasons, tuple(records), seconds, quality)


@dataclass(frozen=True)
class _Loop:
    """One refinement's fixed inputs; `run` does the iterations."""

    renderer: ViewRenderer
    query: Query
    settings: RefineSettings
    frontend: Frontend
    look: Callable[[Frontend], Query]

    def stronger(self, usable: int, views: int) -> _Loop:
        """The loop with the features that should look on where these found no answer; itself when there are none."""
        frontend = self.frontend.stronger(usable, views)
        return self if frontend is None else replace(self, frontend=frontend, query=self.look(frontend))

    def run(self, start: Pose, records: list[IterationRecord]) -> Generator[RefineProgress, None, Outcome]:
        """Iterates from `start` and returns the best answer."""
        settings, rng = self.settings, np.random.default_rng(self.settings.seed)
        fan = narrow = Fan(settings.perturb_translation_ratio, settings.perturb_rotation_deg)
        pose, best, problem, agreement, loop = start, None, "", 0.0, self
        for index in range(settings.iterations):
            observations = yield from loop._observe(pose, fan, index, rng)
            if not observations:
                return Outcome(best, LOOKS_AWAY, agreement)
            if index == 0:
                agreement = compare(self.query, observations[0].grey, observations[0].solid).agreement
            found, record = loop._solve(observations, pose, index)
            records.append(record)
            yield RefineProgress(
                index + 1, settings.iterations, "iteration done", 0.95 * (index + 1) / settings.iterations, record
            )
            if found is None:
                problem = _too_few(observations, record)
                fan, pose, loop = fan.wider(), record.pose, loop.stronger(record.views_used, len(observations))
                continue
            if best is not None and not _supports(found, best):
                break  # fewer matches agree than before: a later iteration must not spoil a good pose
            best, pose, moved_from = found, found.fit.pose, pose
            if settings.multiview and fan == narrow and _inside_fan(found, moved_from, fan):
                break
            fan = narrow
        return Outcome(best, problem, agreement)

    def _observe(
        self, pose: Pose, fan: Fan, index: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, list[Observation]]:
        """Renders and matches the reference and its candidates; empty when the reference sees nothing of the scan."""
        count = self.settings.candidates if self.settings.multiview else 0
        done = 0.95 * index / self.settings.iterations
        share = 0.95 / self.settings.iterations / (count + 1)
        yield RefineProgress(index + 1, self.settings.iterations, "rendering the reference view", done)
        reference = observe(self.renderer, self.query, pose, True, self.frontend)
        if reference.opaque < MIN_OPAQUE:
            return []
        poses = candidate_poses(pose, count, fan.ratio * reference.median_depth, fan.rotation_deg, rng)
        out = [reference]
        pool = ThreadPoolExecutor(self.settings.threads or os.cpu_count() or 1, thread_name_prefix="gssmc-view")
        try:
            jobs = [pool.submit(observe, self.renderer, self.query, p, False, self.frontend) for p in poses]
            for k, job in enumerate(jobs):
                yield RefineProgress(
                    index + 1, self.settings.iterations, f"view {k + 2} of {count + 1}", done + share * (k + 1)
                )
                out.append(job.result())
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
        return out

    def _solve(self, observations: Sequence[Observation], pose: Pose, index: int) -> tuple[Answer | None, IterationRecord]:
        """Coarse and fine stage on one iteration's views."""
        K = self.query.pinhole.matrix
        matches = sum(len(o.matches) for o in observations)
        usable = usable_views(observations, self.query.pinhole.focal)
        coarse = coarse_pose(observations, usable, K, self.settings.multiview)
        if coarse is None:
            return None, IterationRecord(index, len(usable), matches, 0, float("nan"), pose)
        if self.settings.epipolar:
            views = fine_matches(coarse, observations, self.query, self.frontend)
            fit = fine_pose(coarse, views, K) if views else None
            if fit is not None and len(views) == 1:
                fit = keep_distance(fit, coarse, views[0], K)
        else:
            views = [u.inliers for u in usable]
            fit = measure_epipolar(coarse, views, K)
        inliers = sum(len(v) for v in views)
        if fit is None:
            return None, IterationRecord(index, len(usable), matches, inliers, float("nan"), coarse)
        record = IterationRecord(index, len(usable), matches, inliers, fit.rms_px, fit.pose)
        return Answer(fit, tuple(views), observations[0].median_depth), record


def _too_few(observations: Sequence[Observation], record: IterationRecord) -> str:
    return (
        f"Too few matches: {record.matches} over {len(observations)} views, {record.views_used} of them usable; "
        "the photo may show another place, or the start is too far off: move the camera closer to the photo's view."
    )


def _supports(found: Answer, best: Answer) -> bool:
    """Whether the new answer is held by about as many matches as the one before, or more."""
    return sum(map(len, found.views)) >= 0.7 * sum(map(len, best.views))


def _inside_fan(found: Answer, reference: Pose, fan: Fan) -> bool:
    """Whether the rendered views surround the answer, so that another iteration would see the same again."""
    distance, degrees = pose_error(found.fit.pose, reference)
    return distance <= GAUSSIAN_LENGTH * fan.ratio * found.median_depth and degrees <= INSIDE_FAN_DEG
