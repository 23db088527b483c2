"""The refinement: from a rough camera to the photo's own camera, step by step."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..features.frontend import Frontend, make_frontend
from ..geometry.camera import Camera, Intrinsics
from ..photos.photo import Photo
from ..render.view import ViewRenderer
from ..support.steps import converted, run_to_end
from ..support.words import counted
from .final.solution import FittedCamera, from_epipolar
from .final.stage import FinalStage
from .report import EvidenceOf, IterationRecord, PoseQuality, RefineProgress, RefineReport, Verdict
from .search.loop import LOOP_SHARE, Answer, Loop, LoopResult
from .search.observe import PhotoFeatures, extract_photo_features
from .settings import RefineSettings
from .shared.lens import CameraUnknowns, LensMode
from .shared.working import WorkingPhoto
from .verdict import sentences
from .verdict.verdict import LoopMatches, assess, assess_start, fits_better, judge
from .verdict.verify import FinalView, view_at

log = logging.getLogger(__name__)

Progress = Generator[RefineProgress, None, "RefineReport"]

MIN_PHOTO_FEATURES = 30
# The start is kept where the refined camera agrees with fewer of the photo's corners by more than this share.
WORSE_AGREEMENT = 0.05


def refine(
    renderer: ViewRenderer,
    photo: Photo,
    camera: Camera,
    settings: RefineSettings | None = None,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Runs `iterate_refinement` to its end. `on_progress` may raise (for example Cancelled) to stop it."""
    return run_to_end(iterate_refinement(renderer, photo, camera, settings or RefineSettings()), on_progress)


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
    refinement = _Refinement(renderer, photo, camera, settings, lens_mode(settings, camera))
    extract = partial(extract_photo_features, photo, camera.intrinsics, settings.long_side_px)
    loop, features = Loop(renderer, settings, frontend, refinement.mode, extract), extract(frontend)
    records: list[IterationRecord] = []
    if len(features) < MIN_PHOTO_FEATURES:
        loop, features = loop.stronger(features, 0, 1)
    if len(features) < MIN_PHOTO_FEATURES:
        reason = f"The photo shows only {counted(len(features), 'feature')}; it is too dark, blurred or plain to be placed."
        return refinement.report(None, _Judgement("failed", (reason,)), records, began)
    rng = np.random.default_rng(settings.seed)
    result = yield from loop.run(features, camera.pose, records, rng)
    answer = result.answer
    if answer is None:
        return refinement.report(None, _Judgement("failed", (result.problem,), result.details), records, began)
    solution, agreement = yield from refinement.finish(features, answer, len(records), rng)
    judgement = refinement.judge(answer, solution, agreement, result)
    refined = refinement.full_size(solution.camera) if judgement.is_of("refined") else None
    return refinement.report(refined, judgement, records, began, None if judgement.is_of("start") else solution)


def lens_mode(settings: RefineSettings, camera: Camera) -> LensMode:
    """What of the lens is solved for; "auto" trusts a calibration and solves for the focal length of a guess."""
    if settings.lens != "auto":
        return settings.lens
    return "focal" if camera.focal_guessed else "fixed"


@dataclass(frozen=True)
class _Judgement:
    """The verdict with its words, and the evidence where a pose was found."""

    verdict: Verdict
    reasons: tuple[str, ...]
    details: tuple[str, ...] = ()
    quality: PoseQuality | None = None

    def is_of(self, pose: EvidenceOf) -> bool:
        """Whether there is evidence and it belongs to the pose named."""
        return self.quality is not None and self.quality.of == pose


@dataclass(frozen=True)
class _Refinement:
    """One refinement's inputs, and what is made of them after the loop: last stage, verdict and report. `mode`: what of the
    lens is solved for.
    """

    renderer: ViewRenderer
    photo: Photo
    start: Camera
    settings: RefineSettings
    mode: LensMode

    def finish(
        self, photo: PhotoFeatures, answer: Answer, iterations: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, tuple[FittedCamera, FinalView]]:
        """The last stage after the loop, and how well the render at its answer agrees with the photo."""
        image = photo.image.with_intrinsics(answer.intrinsics)
        solution: FittedCamera | None = None
        if self.settings.has_final_stage:
            solution = yield from self._final(answer, iterations, rng)
        yield RefineProgress(iterations, self.settings.iterations, "checking the answer", 0.97)
        if solution is None:
            loop = from_epipolar(answer.fit, answer.views, answer.intrinsics, answer.median_depth, self.mode)
            return loop, view_at(self.renderer, image, loop.camera.pose)
        lens = solution.camera.intrinsics.resized(image.intrinsics.width, image.intrinsics.height)
        return solution, view_at(self.renderer, image.with_intrinsics(lens), solution.camera.pose)

    def _final(
        self, answer: Answer, iterations: int, rng: np.random.Generator
    ) -> Generator[RefineProgress, None, FittedCamera | None]:
        photo = WorkingPhoto.of(self.photo, self.start.intrinsics, self.settings.final_long_side_px)
        size = (photo.intrinsics.width, photo.intrinsics.height)
        start = CameraUnknowns(answer.fit.pose, answer.intrinsics.resized(*size))
        work = FinalStage(self.renderer, self.settings, photo.intrinsics, self.mode).run(photo, start, rng)
        fraction = LOOP_SHARE

        def progress(step: str) -> RefineProgress:
            nonlocal fraction
            # The number of passes is not known beforehand, so that each step takes a share of what is left.
            fraction += 0.05 * (0.97 - fraction)
            return RefineProgress(iterations, self.settings.iterations, step, fraction)

        return (yield from converted(work, progress))

    def full_size(self, camera: CameraUnknowns) -> Camera:
        """The camera for the photo at its full size; the given lens itself where it was not solved for."""
        given = self.start.intrinsics
        if self.mode == "fixed":
            return replace(self.start, pose=camera.pose)
        lens: Intrinsics = camera.intrinsics.resized(given.width, given.height)
        return replace(self.start, pose=camera.pose, intrinsics=lens, focal_guessed=False)

    def judge(self, answer: Answer, solution: FittedCamera, final: FinalView, loop: LoopResult) -> _Judgement:
        """The verdict, with the evidence of the pose that is returned, or of the one that is not and why."""
        photo = self.start.intrinsics
        quality = assess(solution, LoopMatches(answer.views, answer.intrinsics.pinhole(), answer.median_depth), final, photo)
        verdict, reasons = judge(quality)
        if verdict == "failed":
            quality = replace(quality, of="rejected")
        elif loop.start is not None and fits_better(loop.start, final, WORSE_AGREEMENT):
            kept = assess_start(self.start.pose, loop.start, photo, loop.start_depth)
            rejected = sentences.details(replace(quality, of="rejected"))
            return _Judgement("check", (sentences.start_kept(kept, quality),), (*sentences.details(kept), *rejected), kept)
        return _Judgement(verdict, reasons, sentences.details(quality), quality)

    def report(
        self,
        refined: Camera | None,
        judgement: _Judgement,
        records: Sequence[IterationRecord],
        began: float,
        solution: FittedCamera | None = None,
    ) -> RefineReport:
        seconds = time.perf_counter() - began
        reasons = judgement.reasons
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
            lens=solution.mode if solution else self.mode,
            details=judgement.details,
        )
