"""The refinement: from a rough camera to the photo's own camera, step by step."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..features.frontend import Frontend, make_frontend
from ..geometry.camera import Camera, Intrinsics, Pose
from ..photos.photo import Photo
from ..render.view import ViewRenderer
from ..support.steps import converted, run_to_end
from ..support.words import counted
from .attempt import DONE, MORE_TRIES, Attempt, Judgement, better, later
from .final.solution import FittedCamera, from_epipolar
from .final.stage import FinalStage
from .lens_report import crop_sentence, lens_evidence, lens_numbers, lens_sentence
from .pins.held import HELD_OUTLIER, left_pins
from .pins.pin import Pin, pinned_points
from .report import IterationRecord, RefineProgress, RefineReport
from .search.loop import LOOP_SHARE, Answer, Loop, LoopResult
from .search.observe import PhotoFeatures, extract_photo_features
from .settings import RefineSettings
from .shared.lens import CameraUnknowns, LensPrior
from .shared.working import WorkingPhoto
from .verdict import sentences
from .verdict.verdict import (
    LoopMatches,
    assess,
    assess_start,
    fits_better,
    is_unsettled,
    judge,
)
from .verdict.verify import FinalView, view_at

log = logging.getLogger(__name__)

Progress = Generator[RefineProgress, None, "RefineReport"]
# What a run adds to, and draws from: the records of all iterations, and random numbers.
_Work = tuple[list[IterationRecord], np.random.Generator]

MIN_PHOTO_FEATURES = 30
# The start is kept where the refined camera agrees with fewer of the photo's corners by more than this share.
WORSE_AGREEMENT = 0.05
# Most iterations of a further run: one from the wide fan, one that settles, one more.
TRY_ITERATIONS = 3


def refine(
    renderer: ViewRenderer,
    photo: Photo,
    camera: Camera,
    settings: RefineSettings | None = None,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Runs `iterate_refinement` to its end. `on_progress` may raise (for example Cancelled) to stop it."""
    return run_to_end(iterate_refinement(renderer, photo, camera, settings or RefineSettings()), on_progress)


def iterate_refinement(
    renderer: ViewRenderer, photo: Photo, camera: Camera, settings: RefineSettings, pins: Sequence[Pin] = ()
) -> Progress:
    """The loop as a generator: yields a `RefineProgress` after every rendered view and returns the `RefineReport`.

    `camera` is the start: its intrinsics belong to the photo at its full size (see `photo.check_size`), its pose is
    world-to-camera in the splat file's coordinates. `pins`: points of the scan that somebody holds to pixels of the photo; they
    pull at the camera in the last stage as much as clicks by hand and their weights say, and where it leaves them, it is
    doubted. Closing the generator cancels; nothing outside it is touched.
    """
    with make_frontend(settings) as frontend:
        return (yield from _refine_with(frontend, _Refinement(renderer, photo, camera, settings, tuple(pins))))


def _refine_with(frontend: Frontend, refinement: _Refinement) -> Progress:
    began = time.perf_counter()
    photo, camera, settings = refinement.photo, refinement.start, refinement.settings
    extract = partial(extract_photo_features, photo, camera.intrinsics, settings.long_side_px)
    loop, features = Loop(refinement.renderer, settings, frontend, refinement.solves_lens, extract), extract(frontend)
    records: list[IterationRecord] = []
    if len(features) < MIN_PHOTO_FEATURES:
        loop, features = loop.stronger(features, 0, 1)
    if len(features) < MIN_PHOTO_FEATURES:
        reason = f"The photo shows only {counted(len(features), 'feature')}; it is too dark, blurred or plain to be placed."
        return refinement.report(None, Judgement("failed", (reason,)), records, began)
    rng = np.random.default_rng(settings.seed)
    tried = yield from refinement.tried(loop, features, camera.pose, (records, rng))
    tried = yield from refinement.tried_again(loop, features, tried, (records, rng))
    judgement, solution = tried.judgement, tried.solution
    refined = refinement.full_size(solution.camera) if solution and judgement.is_of("refined") else None
    return refinement.report(refined, judgement, records, began, None if judgement.is_of("start") else solution)


def solves_lens(settings: RefineSettings, camera: Camera) -> bool:
    """Whether anything of a camera's lens is solved for; "auto" takes a calibration as it is."""
    return camera.focal_guessed if settings.lens == "auto" else settings.lens != "fixed"


@dataclass(frozen=True)
class _Refinement:
    """One refinement's inputs, and what is made of them after the loop: last stage, verdict and report."""

    renderer: ViewRenderer
    photo: Photo
    start: Camera
    settings: RefineSettings
    pins: tuple[Pin, ...] = ()

    @property
    def solves_lens(self) -> bool:
        return solves_lens(self.settings, self.start)

    @property
    def prior(self) -> LensPrior:
        return LensPrior.of(self.start, self.photo.focal_35mm)

    def tried(
        self, loop: Loop, photo: PhotoFeatures, start: Pose, work: _Work, first: LoopResult | None = None
    ) -> Generator[RefineProgress, None, Attempt]:
        """One run from `start`; `first`: what the run from the start camera came to, where this is another one."""
        records, rng = work
        result = yield from loop.run(photo, start, records, rng)
        answer = result.answer
        if answer is None:
            return Attempt(Judgement("failed", (result.problem,), result.details), None, result)
        solution, final = yield from self.finish(photo, answer, len(records), rng)
        return Attempt(self.judge(answer, solution, final, first or result), solution, result)

    def tried_again(
        self, loop: Loop, photo: PhotoFeatures, first: Attempt, work: _Work
    ) -> Generator[RefineProgress, None, Attempt]:
        """`first`, or, where more views may settle the doubts about it, the better of it and of further runs, each from a wide
        fan of other views. They end where a run comes to the same camera again, or leaves no doubt.
        """
        best = first
        few = replace(self.settings, iterations=min(self.settings.iterations, TRY_ITERATIONS))
        for number, start in enumerate(self._other_starts(first)):
            done = DONE + (1 - DONE) * number / MORE_TRIES
            again = self.tried(replace(loop, settings=few, wide=True), photo, start, work, first.loop)
            other = yield from converted(again, partial(later, done=done))
            best, same = better(best, other)
            if same or not is_unsettled(best.judgement.verdict, best.judgement.quality):
                break
        return best

    def _other_starts(self, first: Attempt) -> list[Pose]:
        """Where further runs begin: at the camera that was found, if the lens is known and the camera may be right, and at the
        start camera.
        """
        quality = first.judgement.quality
        if not self.settings.has_final_stage or not is_unsettled(first.judgement.verdict, quality):
            return []
        known = not self.solves_lens and first.judgement.is_of("refined") and first.solution is not None
        found = [first.solution.camera.pose] if known and first.solution else []
        return [*found, self.start.pose][:MORE_TRIES]

    def finish(
        self, photo: PhotoFeatures, answer: Answer, iterations: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, tuple[FittedCamera, FinalView]]:
        """The last stage after the loop, and how well the render at its answer agrees with the photo."""
        image = photo.image.with_intrinsics(answer.intrinsics)
        solution: FittedCamera | None = None
        if self.settings.has_final_stage:
            solution = yield from self._final(answer, iterations, rng)
        yield RefineProgress(iterations, self.settings.iterations, "checking the answer", DONE)
        if solution is None:
            loop = from_epipolar(answer.fit, answer.views, answer.intrinsics, answer.median_depth, self.prior)
            return loop, view_at(self.renderer, image, loop.camera.pose)
        lens = solution.camera.intrinsics.resized(image.intrinsics.width, image.intrinsics.height)
        return solution, view_at(self.renderer, image.with_intrinsics(lens), solution.camera.pose)

    def _final(
        self, answer: Answer, iterations: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, FittedCamera | None]:
        photo = WorkingPhoto.of(self.photo, self.start.intrinsics, self.settings.final_long_side_px)
        size = (photo.intrinsics.width, photo.intrinsics.height)
        start = CameraUnknowns(answer.fit.pose, answer.intrinsics.resized(*size))
        stage = FinalStage.of(self.renderer, self.settings, self.prior.resized(*size))
        if self.pins:
            given = self.start.intrinsics
            held = pinned_points(self.pins, given, HELD_OUTLIER).resized(size[0] / given.width, size[1] / given.height)
            stage = replace(stage, pins=held)
        work = stage.run(photo, start, rng)
        fraction = LOOP_SHARE

        def progress(step: str) -> RefineProgress:
            nonlocal fraction
            # The number of passes is not known beforehand, so that each step takes a share of what is left.
            fraction += 0.05 * (DONE - fraction)
            return RefineProgress(iterations, self.settings.iterations, step, fraction)

        return (yield from converted(work, progress))

    def full_size(self, camera: CameraUnknowns) -> Camera:
        """The camera for the photo at its full size; the given lens itself where it was not solved for."""
        given = self.start.intrinsics
        if not self.solves_lens:
            return replace(self.start, pose=camera.pose)
        lens: Intrinsics = camera.intrinsics.resized(given.width, given.height)
        return replace(self.start, pose=camera.pose, intrinsics=lens, focal_guessed=False)

    def judge(self, answer: Answer, solution: FittedCamera, final: FinalView, loop: LoopResult) -> Judgement:
        """The verdict, with the evidence of the pose that is returned, or of the one that is not and why."""
        photo = self.start.intrinsics
        quality = assess(solution, LoopMatches(answer.views, answer.intrinsics.pinhole(), answer.median_depth), final, photo)
        verdict, reasons = judge(quality)
        if verdict == "failed":
            quality = replace(quality, of="rejected")
        elif loop.start is not None and fits_better(loop.start, final, WORSE_AGREEMENT):
            kept = assess_start(self.start.pose, loop.start, photo, loop.start_depth)
            rejected = sentences.details(replace(quality, of="rejected"))
            return Judgement("check", (sentences.start_kept(kept, quality),), (*sentences.details(kept), *rejected), kept)
        left = left_pins(self.pins, self.full_size(solution.camera)) if verdict != "failed" else ""
        if left:
            verdict, reasons = "check", (left, *(reasons if verdict == "check" else ()))
        return Judgement(verdict, reasons, sentences.details(quality), quality)

    def _cropped(self, solution: FittedCamera | None) -> str:
        """That the photo is a crop, where what EXIF says of its focal length was refuted; else nothing."""
        if solution is None or self.prior.source != "exif" or solution.prior.source == "exif" or not self.photo.focal_35mm:
            return ""
        return crop_sentence(solution, self.photo.focal_35mm, self.start.intrinsics)

    def report(
        self,
        refined: Camera | None,
        judgement: Judgement,
        records: Sequence[IterationRecord],
        began: float,
        solution: FittedCamera | None = None,
    ) -> RefineReport:
        seconds = time.perf_counter() - began
        lens = () if solution is None or refined is None else lens_numbers(solution, self.start.intrinsics)
        reasons = tuple(
            r for r in (*judgement.reasons, self._cropped(solution), lens_sentence(lens, self.start.intrinsics)) if r
        )
        log.info("%s after %d iterations, %.1f s: %s", judgement.verdict, len(records), seconds, " ".join(reasons))
        log.debug("%s", " ".join(judgement.details))
        return RefineReport(
            camera=refined or self.start,
            start=self.start,
            verdict=judgement.verdict,
            reasons=reasons,
            iterations=tuple(records),
            seconds=seconds,
            quality=judgement.quality,
            stage=solution.stage if solution else "",
            lens=lens,
            lens_evidence=lens_evidence(solution, self.start.intrinsics) if solution and lens else None,
            details=judgement.details,
        )
