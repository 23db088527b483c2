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
from ..shared.lens import CameraUnknowns, LensMode
from ..shared.matches import ViewMatches
from ..shared.surface import solid_part
from ..shared.working import WorkingPhoto
from .guided import Corners, PosedRender, follow, match_corners, pick_corners
from .joint import FIT_KINDS, FitKind, JointFit, JointProblem, fit_distortion, fit_joint, held_out_px, rms_gain
from .solution import FittedCamera, from_joint

log = logging.getLogger(__name__)

# Fewer followed corners in a view say nothing that the matches of the loop did not say.
MIN_CORNERS = 40
MIN_VIEWS = 2
MAX_PASSES = 3
# A pass that moved the camera by less than this share of the median depth, and the angle and zoom below, ends the stage.
SETTLED = 0.003
SETTLED_DEG = 0.15
SETTLED_FOCAL = 0.002
# If distortion lowers the RMS by this share, the photo has a distortion that the given lens lacks.
DISTORTION_GAIN = 0.2
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
    """The fixed inputs of the last stage; `run` does the work. `prior`: the lens as it was given, at the photo's working size;
    `mode`: what of the lens is solved for.
    """

    renderer: ViewRenderer
    settings: RefineSettings
    prior: Intrinsics
    mode: LensMode

    def run(
        self, photo: WorkingPhoto, start: CameraUnknowns, rng: np.random.Generator
    ) -> Generator[str, None, FittedCamera | None]:
        """Refines `start` (intrinsics of `photo`) against fresh renders; yields what it is doing, returns None when too little
        is seen. A pass that still moved the camera is repeated from where it ended, because matches are looked for around the
        pose.
        """
        stage, camera, last = self, start, None
        for _ in range(MAX_PASSES):
            photo = photo.with_intrinsics(camera.intrinsics)
            result = yield from stage._pass(photo, camera, rng)
            if result is None:
                break
            last, before, camera = result, camera, result.fit.camera
            if last.fit.problem.mode != stage.mode:
                # Another lens moves the photo's pixels, which is a move like any other.
                stage = replace(stage, mode=last.fit.problem.mode)
            elif _settled(before, camera, last.median_depth):
                break
        if last is None:
            return None
        distorted = last.distorted or fit_distortion(last.fit)
        return from_joint(last.fit, last.median_depth, rms_gain(last.fit, distorted))

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
        fit, distorted = self._solve(camera, views, reference, photo.intrinsics)
        return _PassResult(fit, depth, distorted)

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

    def _solve(
        self, camera: CameraUnknowns, views: Sequence[ViewMatches], reference: ViewMatches, k: Intrinsics
    ) -> tuple[JointFit, JointFit | None]:
        """The fit of the kind that the settings name; "auto" takes the kind that best explains the reference view's matches,
        which take no part in those fits: at (nearly) no baseline they lean neither to epipolar lines nor to depth.

        Where the focal length was guessed and nothing else is said of the lens, the same fit is made with distortion and takes
        the first one's place if it is clearly better. It is the second result, None where it was not made.
        """
        problem = JointProblem.of(views, k, self.prior, self.mode)
        if self.settings.final in FIT_KINDS:
            kind: FitKind = self.settings.final
            start = camera
        else:
            fits = {kind: fit_joint(camera, problem, kind) for kind in FIT_KINDS}
            kind = choose(fits, JointProblem.of([reference], k, self.prior, self.mode))
            start = fits[kind].camera
        if kind != "epipolar" and len(reference) >= MIN_CORNERS:
            # The choice was made without the reference view and the fit is made with it. An epipolar fit leaves it out, because
            # lines of (nearly) no baseline would only turn with the noise.
            problem = JointProblem.of([*views, reference], k, self.prior, self.mode)
        fit = fit_joint(start, problem, kind)
        if self.mode == "focal" and self.settings.lens == "auto":
            distorted = fit_distortion(fit)
            return (distorted if rms_gain(fit, distorted) > DISTORTION_GAIN else fit), distorted
        return fit, None


@dataclass(frozen=True, eq=False)
class _PassResult:
    """What a pass came to: the fit, the median rendered depth (scene units), and the fit with distortion where it was made."""

    fit: JointFit
    median_depth: float
    distorted: JointFit | None


def _settled(before: CameraUnknowns, after: CameraUnknowns, depth: float) -> bool:
    distance, degrees = pose_error(after.pose, before.pose)
    zoomed = abs(np.log(after.intrinsics.focal / before.intrinsics.focal))
    return bool(distance < SETTLED * depth and degrees < SETTLED_DEG and zoomed < SETTLED_FOCAL)


def choose(fits: dict[FitKind, JointFit], held_out: JointProblem) -> FitKind:
    """The joint fit, unless another one explains the held-out matches clearly better."""
    if not len(held_out.weights):
        return "joint"
    errors = {kind: held_out_px(fit.camera, held_out) for kind, fit in fits.items()}
    log.debug("held-out errors: %s", errors)
    best = min(errors, key=lambda kind: errors[kind])
    return best if errors[best] < AUTO_MARGIN * errors["joint"] else "joint"
