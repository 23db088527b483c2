"""The last fit: epipolar lines and rendered depth of all views in one robust problem, with the lens among the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np

from ..camera import FloatArray, Intrinsics
from .least_squares import NormalEquations, levenberg_marquardt
from .lens import FREE, PRIOR_STD, LensCamera, LensMode, lens_difference
from .matches import ViewMatches, bearings
from .reprojection import Reprojection, reproject, robust_across_px, whiten

Stage = Literal["joint", "epipolar", "depth"]
STAGES: tuple[Stage, ...] = get_args(Stage)

SCALE = 2.0  # of the Geman-McClure loss, in deviations
ROUNDS = 4  # of re-estimating deviations around the falling residuals
CELLS = 20  # cells along the photo's long side
CELL_CORRELATION = 0.3  # variance that matches of one cell share, as a share of a match's own


@dataclass(frozen=True)
class JointFit:
    """The fitted camera, and how well it holds.

    rms_px: RMS of the residuals across the epipolar lines, outliers left out, pixels; information (6 + F, 6 + F): inverse
    covariance of (xi, F free lens numbers).
    """

    camera: LensCamera
    rms_px: float
    information: FloatArray


@dataclass(frozen=True)
class JointProblem:
    """Views with their matches' pixels in the distorted photo and density weights; `prior` is the lens as it was given.

    `intrinsics` are those under which the matches' `query` coordinates were made.
    """

    views: tuple[ViewMatches, ...]
    seen: tuple[FloatArray, ...]
    weights: tuple[FloatArray, ...]
    prior: Intrinsics
    mode: LensMode

    @property
    def free(self) -> int:
        return FREE[self.mode]

    @classmethod
    def of(
        cls, views: Sequence[ViewMatches], intrinsics: Intrinsics, prior: Intrinsics, mode: LensMode = "fixed"
    ) -> JointProblem:
        """From matches; those without depth are left out."""
        known = tuple(v.take(np.isfinite(v.depth) & (v.depth > 0)) for v in views)
        seen = tuple(intrinsics.project(bearings(v.query)) for v in known)
        return cls(known, seen, density_weights(seen, intrinsics), prior, mode)

    def with_mode(self, mode: LensMode) -> JointProblem:
        """The same problem with other numbers of the lens free."""
        return replace(self, mode=mode)

    def part(self, keep: slice) -> JointProblem:
        """The same problem on some of the views."""
        return replace(self, views=self.views[keep], seen=self.seen[keep], weights=self.weights[keep])


def density_weights(seen: Sequence[FloatArray], k: Intrinsics) -> tuple[FloatArray, ...]:
    """Weights (M,) of each view's matches: a cell of the photo with n matches over all views weighs n / (1 + c n).

    A splat that is a little off at a place is so in every view and for every match there; counted as independent, a
    textured corner would outvote the rest of the photo.
    """
    if not seen:
        return ()
    size = max(k.width, k.height) / CELLS
    cells = [np.floor(s / size).astype(np.int64) @ (1, 4 * CELLS) for s in seen]
    _, index, count = np.unique(np.concatenate(cells), return_inverse=True, return_counts=True)
    weights = 1 / (1 + CELL_CORRELATION * count[index])
    return tuple(np.split(weights, np.cumsum([len(c) for c in cells])[:-1]))


def fit_joint(start: LensCamera, problem: JointProblem, stage: Stage) -> JointFit:
    """The camera of least cost near `start`, by the stage that is wanted."""
    camera = start
    for _ in range(ROUNDS):
        sigmas = [robust_across_px(r) for r in _reprojections(camera, problem)]
        camera = levenberg_marquardt(
            camera, partial(_equations, problem=problem, stage=stage, sigmas=sigmas), lambda c, step: c.moved(step)
        )
    reprojections = _reprojections(camera, problem)
    sigmas = [robust_across_px(r) for r in reprojections]
    across = [r.sides()[3] for r in reprojections]
    inliers = np.concatenate([a[np.abs(a) < 3 * s] for a, s in zip(across, sigmas, strict=True)])
    rms = float(np.sqrt(np.mean(inliers**2))) if len(inliers) else float("inf")
    return JointFit(camera, rms, _equations(camera, problem, stage, sigmas).information)


def held_out_px(camera: LensCamera, problem: JointProblem) -> float:
    """Robust mean reprojection error, pixels, of matches that took no part in a fit; each counts up to a few pixels only."""
    total, weight = 0.0, 0.0
    for r, w in zip(_reprojections(camera, problem), problem.weights, strict=True):
        squared = (r.residual**2).sum(1)
        total += float((w * squared / (1 + squared)).sum())
        weight += float(w.sum())
    return float(np.sqrt(total / weight)) if weight else float("inf")


def _reprojections(camera: LensCamera, problem: JointProblem) -> list[Reprojection]:
    return [reproject(camera, v, s, problem.free) for v, s in zip(problem.views, problem.seen, strict=True)]


def _equations(camera: LensCamera, problem: JointProblem, stage: Stage, sigmas: Sequence[float]) -> NormalEquations:
    size = 6 + problem.free
    cost, gradient, information = 0.0, np.zeros(size), np.zeros((size, size))
    for r, view, weight, sigma in zip(_reprojections(camera, problem), problem.views, problem.weights, sigmas, strict=True):
        sigma_depth = {"epipolar": np.full(len(view), np.inf), "depth": np.zeros(len(view)), "joint": view.depth_std}[stage]
        white, jac = whiten(r, sigma, sigma_depth)
        squared = (white**2).sum(1) / SCALE**2
        front = r.z > 0
        cost += float((weight * np.where(front, squared / (1 + squared), 1.0)).sum()) * SCALE**2 / 2
        w = np.where(front, weight / (1 + squared) ** 2, 0.0)
        gradient += np.einsum("nij,ni,n->j", jac, white, w)
        information += np.einsum("nij,nik,n->jk", jac, jac, w)
    if problem.free:
        prior = 1 / PRIOR_STD[: problem.free] ** 2
        difference = lens_difference(camera.intrinsics, problem.prior)[: problem.free]
        cost += 0.5 * float(prior @ difference**2)
        gradient[6:] += prior * difference
        information[6:, 6:] += np.diag(prior)
    return NormalEquations(cost, gradient, information)
