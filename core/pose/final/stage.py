"""The last stage: renders around the nearly right pose at a finer scale, and the fit that explains them best."""

from __future__ import annotations

import logging
import os
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from ...geometry.camera import Intrinsics, Pose, pose_error
from ...render.view import ViewRenderer, alone
from ..search.hypotheses import candidate_poses
from ..settings import RefineSettings
from ..shared.lens import LensCamera, LensMode
from ..shared.matches import ViewMatches
from ..shared.surface import solid_part
from ..shared.working import WorkingPhoto
from .guided import Corners, follow, match_corners, pick_corners
from .joint import STAGES, JointFit, JointProblem, Stage, fit_joint, held_out_px
from .solution import Solution, from_joint

log = logging.getLogger(__name__)

MIN_CORNERS = 40  # followed corners in a view; fewer say nothing that the loop's matches did not
MIN_VIEWS = 2
MAX_PASSES = 3
SETTLED = 0.003  # of the median depth, and degrees: a pass that moved less than this ends the stage
SETTLED_DEG = 0.15
SETTLED_FOCAL = 0.002
LENS_GAIN = 0.2  # fall of the reprojection error from which the photo has a distortion that its lens does not tell of
AUTO_MARGIN = 0.97  # another stage than the joint one must explain the held-out matches better by this factor


@contextmanager
def view_pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Threads that draw and match views side by side; 0 = one per core. What has not begun is dropped at the end."""
    pool = ThreadPoolExecutor(threads or os.cpu_count() or 1, thread_name_prefix="gssmc-view")
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def final_stage(
    renderer: ViewRenderer,
    photo: WorkingPhoto,
    start: LensCamera,
    prior: Intrinsics,
    settings: RefineSettings,
    mode: LensMode,
    rng: np.random.Generator,
) -> Generator[str, None, Solution | None]:
    """Refines `start` (intrinsics of `photo`) against fresh renders; yields what it is doing, returns None when too little is
    seen. `prior` is the lens as it was given, at the photo's size. A pass that still moved the camera is repeated from where it
    ended, because matches are looked for around the pose.
    """
    camera, fit, depth = start, None, 0.0
    for _ in range(MAX_PASSES):
        photo = photo.with_intrinsics(camera.intrinsics)
        found = yield from _pass(renderer, photo, camera, prior, settings, mode, rng)
        if found is None:
            break
        fit, depth = found
        before, camera = camera, fit.camera
        if fit.problem.mode != mode:
            mode = fit.problem.mode  # another lens moves the photo's pixels, which is a move like any other
        elif _settled(before, camera, depth):
            break
    return from_joint(fit, depth) if fit is not None else None


def _settled(before: LensCamera, after: LensCamera, depth: float) -> bool:
    distance, degrees = pose_error(after.pose, before.pose)
    zoomed = abs(np.log(after.intrinsics.focal / before.intrinsics.focal))
    return bool(distance < SETTLED * depth and degrees < SETTLED_DEG and zoomed < SETTLED_FOCAL)


def _pass(
    renderer: ViewRenderer,
    photo: WorkingPhoto,
    camera: LensCamera,
    prior: Intrinsics,
    settings: RefineSettings,
    mode: LensMode,
    rng: np.random.Generator,
) -> Generator[str, None, tuple[JointFit, float] | None]:
    pose = camera.pose
    yield "rendering the photo's view"
    view = alone(renderer).render(photo.pinhole, pose)
    corners = pick_corners(photo, pose, view)
    solid = solid_part(view)
    depth = float(np.median(view.depth[solid])) if solid.any() else 0.0
    if len(corners.pixels) < MIN_CORNERS or depth <= 0:
        return None
    reference = match_corners(view, photo, pose, pose, corners, reference=True)
    sigma = settings.perturb_translation(depth)
    poses = candidate_poses(pose, settings.candidates, sigma, settings.perturb_rotation_deg, rng)
    views = yield from _followed(renderer, photo, pose, poses, corners, settings.threads)
    views = [v for v in views if len(v) >= MIN_CORNERS]
    if len(views) < MIN_VIEWS:
        return None
    return solve_views(camera, views, reference, photo.intrinsics, prior, settings, mode), depth


def _followed(
    renderer: ViewRenderer, photo: WorkingPhoto, pose: Pose, poses: Sequence[Pose], corners: Corners, threads: int
) -> Generator[str, None, list[ViewMatches]]:
    out = []
    with view_pool(threads) as pool:
        jobs = [pool.submit(follow, renderer, photo, pose, p, corners) for p in poses]
        for k, job in enumerate(jobs):
            yield f"fine view {k + 1} of {len(jobs)}"
            out.append(job.result())
    return out


def solve_views(
    camera: LensCamera,
    views: Sequence[ViewMatches],
    reference: ViewMatches,
    k: Intrinsics,
    prior: Intrinsics,
    settings: RefineSettings,
    mode: LensMode,
) -> JointFit:
    """The fit of the views by the stage of the settings; "auto" takes the one that best explains the reference view's matches,
    which take no part in those fits: at (nearly) no baseline they lean neither to epipolar lines nor to depth.

    Where the focal length was guessed and nothing else is said of the lens, one that also bends takes the fit's place if it is
    clearly better.
    """
    problem = JointProblem.of(views, k, prior, mode)
    if settings.final in STAGES:
        stage: Stage = settings.final
        start = camera
    else:
        fits = {stage: fit_joint(camera, problem, stage) for stage in STAGES}
        stage = choose(fits, JointProblem.of([reference], k, prior, mode))
        start = fits[stage].camera
    if stage != "epipolar" and len(reference) >= MIN_CORNERS:
        # chosen without it, fitted with it; lines of (nearly) no baseline would only turn with the noise
        problem = JointProblem.of([*views, reference], k, prior, mode)
    fit = fit_joint(start, problem, stage)
    bends = mode == "focal" and settings.lens == "auto" and fit.lens_gain > LENS_GAIN
    return fit.bent if bends else fit


def choose(fits: dict[Stage, JointFit], held_out: JointProblem) -> Stage:
    """The joint stage, unless another one explains the held-out matches clearly better."""
    if not len(held_out.weights):
        return "joint"
    errors = {stage: held_out_px(fit.camera, held_out) for stage, fit in fits.items()}
    log.debug("held-out errors: %s", errors)
    best = min(errors, key=lambda stage: errors[stage])
    return best if errors[best] < AUTO_MARGIN * errors["joint"] else "joint"
