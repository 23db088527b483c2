"""The last stage: renders around the nearly right pose at a finer scale, and the fit that explains them best."""

from __future__ import annotations

import logging
import os
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import Intrinsics, Pose, pose_error
from ...render.view import ViewRenderer, sole_renderer
from ..search.hypotheses import candidate_poses
from ..settings import RefineSettings
from ..shared.lens import MODES, CameraUnknowns, Free, LensPrior
from ..shared.matches import ViewMatches, bearings
from ..shared.surface import solid_part
from ..shared.working import WorkingPhoto
from .guided import Corners, PosedRender, follow, match_corners, pick_corners
from .joint import FIT_KINDS, FitKind, JointFit, JointProblem, fit_joint, held_out_px
from .pinned import PinnedPoints
from .solution import FittedCamera, from_joint
from .squeeze import with_squeeze

log = logging.getLogger(__name__)

# Fewer followed corners in a view say nothing that the matches of the loop did not say.
MIN_CORNERS = 40
MIN_VIEWS = 2
MAX_PASSES = 3
# A pass ends the stage that moved the camera by less than this share of the median depth and this angle, and the photo's
# pixels, by its other lens, by less than this share of the long side.
SETTLED = 0.003
SETTLED_DEG = 0.15
SETTLED_LENS = 0.001
# Another fit replaces the joint one only where its error on the held-out matches is smaller by this factor.
AUTO_MARGIN = 0.97


@contextmanager
def view_pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Threads that draw and match views side by side; 0 = one per core. At the end, views that have not begun are dropped."""
    pool = ThreadPoolExecutor(threads or os.cpu_count() or 1, thread_name_prefix="gssmc-view")
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@dataclass(frozen=True)
class FinalStage:
    """The fixed inputs of the last stage; `run` does the work. `prior`: what is known of the lens, at the photo's working size;
    `free`: what of it is solved for; `pins`: points that are held to pixels of the photo, at its working size.
    """

    renderer: ViewRenderer
    settings: RefineSettings
    prior: LensPrior
    free: Free
    pins: PinnedPoints | None = None

    @classmethod
    def of(cls, renderer: ViewRenderer, settings: RefineSettings, prior: LensPrior) -> FinalStage:
        """The stage that solves for what the settings name; "auto" takes a calibration as it is, and all of a lens that is a
        guess is solved for: each number under its prior, so that what the matches cannot tell stays where it was guessed.
        """
        if settings.lens == "auto":
            return cls(renderer, settings, prior, () if prior.calibrated else MODES["full"])
        free = MODES[settings.lens]
        return cls(renderer, settings, prior.solving(free), free)

    def run(
        self, photo: WorkingPhoto, start: CameraUnknowns, rng: np.random.Generator
    ) -> Generator[str, None, FittedCamera | None]:
        """Refines `start` (intrinsics of `photo`) against fresh renders; yields what it is doing, returns None when too little
        is seen. A pass that still moved the camera is repeated from where it ended, because matches are looked for around the
        pose.
        """
        camera, last = start, None
        for _ in range(MAX_PASSES):
            photo = photo.with_intrinsics(camera.intrinsics)
            result = yield from self._pass(photo, camera, rng)
            if result is None:
                break
            last, before, camera = result, camera, result.fit.camera
            if _settled(before, camera, last.median_depth):
                break
        if last is None:
            return None
        return from_joint(last.fit, last.median_depth)

    def _pass(
        self, photo: WorkingPhoto, camera: CameraUnknowns, rng: np.random.Generator
    ) -> Generator[str, None, _PassResult | None]:
        """One round of renders and their fit; None when too little is seen."""
        pose = camera.pose
        yield "rendering the photo's view"
        view = sole_renderer(self.renderer).render(photo.pinhole, pose)
        corners = pick_corners(photo, pose, view)
        solid = solid_part(view)
        depth = float(np.median(view.depth[solid])) if solid.any() else 0.0
        if len(corners.pixels) < MIN_CORNERS or depth <= 0:
            return None
        reference = match_corners(PosedRender(view, pose, reference=True), photo, pose, corners)
        sigma = self.settings.perturb_translation(depth)
        poses = candidate_poses(pose, self.settings.candidates, sigma, self.settings.perturb_rotation_deg, rng)
        views = yield from self._followed(photo, pose, poses, corners)
        views = [v for v in views if len(v) >= MIN_CORNERS]
        if len(views) < MIN_VIEWS:
            return None
        return _PassResult(self._solve(camera, views, reference, photo.intrinsics), depth)

    def _followed(
        self, photo: WorkingPhoto, pose: Pose, poses: Sequence[Pose], corners: Corners
    ) -> Generator[str, None, list[ViewMatches]]:
        """The corners' matches with the views at `poses`, in that order."""
        out = []
        with view_pool(self.settings.threads) as pool:
            views = [pool.submit(follow, self.renderer, photo, pose, p, corners) for p in poses]
            for number, view in enumerate(views, 1):
                yield f"fine view {number} of {len(views)}"
                out.append(view.result())
        return out

    def _solve(self, camera: CameraUnknowns, views: Sequence[ViewMatches], reference: ViewMatches, k: Intrinsics) -> JointFit:
        """The fit of the kind that the settings name; "auto" takes the kind that best explains the reference view's matches,
        which take no part in those fits: at (nearly) no baseline they lean neither to epipolar lines nor to depth.
        """
        problem = replace(JointProblem.of(views, k, self.prior, self.free), pins=self.pins)
        if self.settings.final in FIT_KINDS:
            kind: FitKind = self.settings.final
            start = camera
        else:
            fits = {kind: fit_joint(camera, problem, kind) for kind in FIT_KINDS}
            kind = choose(fits, JointProblem.of([reference], k, self.prior, self.free))
            start = fits[kind].camera
        if kind != "epipolar" and len(reference) >= MIN_CORNERS:
            # The choice was made without the reference view and the fit is made with it. An epipolar fit leaves it out, because
            # lines of (nearly) no baseline would only turn with the noise.
            problem = replace(JointProblem.of([*views, reference], k, self.prior, self.free), pins=self.pins)
        fit = fit_joint(start, problem, kind)
        if self.prior.refuted(fit.camera.intrinsics):
            fit = fit_joint(start, replace(problem, prior=self.prior.doubted()), kind)
        return with_squeeze(fit)


@dataclass(frozen=True, eq=False)
class _PassResult:
    """What a pass came to: the fit, and the median rendered depth (scene units)."""

    fit: JointFit
    median_depth: float


def _settled(before: CameraUnknowns, after: CameraUnknowns, depth: float) -> bool:
    distance, degrees = pose_error(after.pose, before.pose)
    return distance < SETTLED * depth and degrees < SETTLED_DEG and _lens_moved(before, after) < SETTLED_LENS


def _lens_moved(before: CameraUnknowns, after: CameraUnknowns) -> float:
    """How far the other lens moves the photo's border at most, as a share of its long side."""
    k = before.intrinsics
    if after.intrinsics == k:
        return 0.0
    border = np.array([(x, y) for x in (0.0, k.width / 2, k.width) for y in (0.0, k.height / 2, k.height)])
    moved = after.intrinsics.project(bearings(k.normalise(border))) - border
    return float(np.linalg.norm(moved, axis=1).max()) / max(k.width, k.height)


def choose(fits: dict[FitKind, JointFit], held_out: JointProblem) -> FitKind:
    """The joint fit, unless another one explains the held-out matches clearly better."""
    if not len(held_out.weights):
        return "joint"
    errors = {kind: held_out_px(fit.camera, held_out) for kind, fit in fits.items()}
    log.debug("held-out errors: %s", errors)
    best = min(errors, key=lambda kind: errors[kind])
    return best if errors[best] < AUTO_MARGIN * errors["joint"] else "joint"
