"""The last fit: epipolar lines and rendered depth of all views in one robust problem, with the lens among the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray, Intrinsics
from ..shared.least_squares import NormalEquations, levenberg_marquardt
from ..shared.lens import ALL, CameraUnknowns, Free, LensPrior
from ..shared.matches import ViewMatches, bearings
from ..shared.robust import robust_std
from .pinned import PinnedPoints
from .reprojection import Lifted, apply, reproject, whitening

FitKind = Literal["joint", "epipolar", "depth"]
FIT_KINDS: tuple[FitKind, ...] = get_args(FitKind)

# The scale of the Geman-McClure loss, in standard deviations.
SCALE = 2.0
# How often the deviations are estimated again from the falling residuals.
ROUNDS = 4
# Number of cells along the photo's long side.
CELLS = 20
# The variance that the matches of one cell have in common, as a share of a single match's variance.
CELL_CORRELATION = 0.3
# Matches know the camera less well than their noise says, because the errors of the splat itself are the same in all views. On
# three scans, with the lens given and unknown, the errors of pose and focal length were 2.6 times (RMS) what the noise leads to
# expect.
SHARED_ERROR = 2.6
CERTAINTY = SHARED_ERROR**-2
# Number of columns in one matrix product.
BLOCK = 1024


@dataclass(frozen=True, eq=False)
class JointProblem:
    """M matches of V views, with density weights (M,), what was known of the lens, and which of its numbers are solved for.
    counts (V,): matches of each view, which stand one after the other; pins: points that somebody holds to pixels of the photo,
    which then take part in every fit of the whole problem.
    """

    matches: Lifted
    weights: FloatArray
    counts: NDArray[np.int64]
    prior: LensPrior
    free: Free = ()
    pins: PinnedPoints | None = None

    @classmethod
    def of(cls, views: Sequence[ViewMatches], intrinsics: Intrinsics, prior: LensPrior, free: Free = ()) -> JointProblem:
        """From matches of at least one view; those without depth are left out. `intrinsics` are those under which the matches'
        `query` coordinates were made.
        """
        known = [v.take(np.isfinite(v.depth) & (v.depth > 0)) for v in views]
        observed = [intrinsics.project(bearings(v.query)) for v in known]
        counts = np.array([len(v) for v in known], np.int64)
        return cls(Lifted.of(known, observed), density_weights(np.concatenate(observed), intrinsics), counts, prior, free)

    def part(self, keep: slice) -> JointProblem:
        """The same problem on some of the views, and without pins, because it is to tell what the views know by themselves."""
        chosen = np.zeros(len(self.counts), np.bool_)
        chosen[keep] = True
        of = np.repeat(chosen, self.counts)
        matches, weights = self.matches.take(of), self.weights[of]
        return replace(self, matches=matches, weights=weights, counts=self.counts[keep], pins=None)

    def deviations_px(self, across: FloatArray) -> FloatArray:
        """Robust deviation (M,), the same for all matches of a view, of the residuals `across` (M,) their lines, pixels."""
        views = np.split(across, np.cumsum(self.counts)[:-1])
        return np.repeat([robust_std(a) for a in views], self.counts)


@dataclass(frozen=True, eq=False)
class JointFit:
    """The fitted camera, and how well it holds; of which problem, by which kind of fit.

    rms_px: RMS of the residuals across the epipolar lines, outliers left out, pixels. evidence: the equations of the matches
    alone at the camera, by xi and all numbers of the lens (15,), whether they were free or not.
    """

    camera: CameraUnknowns
    rms_px: float
    evidence: NormalEquations
    problem: JointProblem
    kind: FitKind

    @property
    def information(self) -> FloatArray:
        """Inverse covariance (15, 15) of xi and all numbers of the lens. What was held is in it as uncertain as prior and
        matches leave it, so that the deviations of the pose know of it.
        """
        prior = np.concatenate([np.zeros(6), self.problem.prior.information])
        return np.asarray(self.evidence.information + np.diag(prior))

    def halves(self) -> list[CameraUnknowns]:
        """The cameras that two halves of the views give (every second view, and the views between), each fit started here."""
        return [fit_joint(self.camera, self.problem.part(slice(i, None, 2)), self.kind).camera for i in (0, 1)]


def density_weights(observed: FloatArray, k: Intrinsics) -> FloatArray:
    """Weights (M,) of matches whose pixels in the photo are `observed` (M, 2): a cell of the photo that holds n of them, over
    all views, weighs n / (1 + c n).

    A splat that is a little off at a place is so in every view and for every match there; counted as independent, a
    textured corner would outvote the rest of the photo.
    """
    cells = np.floor(observed / (max(k.width, k.height) / CELLS)).astype(np.int64) @ (1, 4 * CELLS)
    _, index, count = np.unique(cells, return_inverse=True, return_counts=True)
    return np.asarray(1 / (1 + CELL_CORRELATION * count[index]))


def fit_joint(start: CameraUnknowns, problem: JointProblem, kind: FitKind) -> JointFit:
    """The camera of least cost near `start`. `kind`: "joint" weighs each depth by its deviation, "epipolar" ignores the
    depths, "depth" takes them as exact.
    """
    camera = start
    for _ in range(ROUNDS):
        sigma_px = problem.deviations_px(reproject(camera, problem.matches).across)
        equations = partial(_equations, problem=problem, kind=kind, sigma_px=sigma_px)
        camera = levenberg_marquardt(camera, equations, lambda c, step: c.moved(step, problem.free))
    across = reproject(camera, problem.matches).across
    sigma_px = problem.deviations_px(across)
    inliers = across[np.abs(across) < 3 * sigma_px]
    rms = float(np.sqrt(np.mean(inliers**2))) if len(inliers) else float("inf")
    return JointFit(camera, rms, _by_matches(camera, replace(problem, free=ALL), kind, sigma_px), problem, kind)


def cost_of(camera: CameraUnknowns, problem: JointProblem, kind: FitKind, weighed_by: CameraUnknowns) -> NormalEquations:
    """The equations at `camera`, with the deviations of the residuals that `weighed_by` leaves, for only then can costs be
    compared.
    """
    return _equations(camera, problem, kind, problem.deviations_px(reproject(weighed_by, problem.matches).across))


def held_out_px(camera: CameraUnknowns, problem: JointProblem) -> float:
    """Robust mean reprojection error, pixels, of matches that took no part in a fit; each counts up to a few pixels only."""
    squared = (reproject(camera, problem.matches).residual ** 2).sum(0)
    return float(np.sqrt((problem.weights * squared / (1 + squared)).sum() / problem.weights.sum()))


def _equations(camera: CameraUnknowns, problem: JointProblem, kind: FitKind, sigma_px: FloatArray) -> NormalEquations:
    """The equations of the matches and of the lens's prior by xi and the free lens numbers."""
    e, free = _by_matches(camera, problem, kind, sigma_px), list(problem.free)
    prior, off = problem.prior.information[free], problem.prior.off(camera.intrinsics)[free]
    gradient, information = e.gradient.copy(), e.information.copy()
    gradient[6:] += prior * off
    information[6:, 6:] += np.diag(prior)
    return NormalEquations(e.cost + 0.5 * float(prior @ off**2), gradient, information)


def _by_matches(camera: CameraUnknowns, problem: JointProblem, kind: FitKind, sigma_px: FloatArray) -> NormalEquations:
    """The equations of the matches, and of the pins where there are some."""
    line = linearised(camera, problem, kind, sigma_px)
    gradient, information = products(line.jacobian, line.residual)
    matches = NormalEquations(CERTAINTY * line.cost, CERTAINTY * gradient, CERTAINTY * information)
    if problem.pins is None:
        return matches
    held = problem.pins.equations(camera, problem.free)
    return NormalEquations(matches.cost + held.cost, matches.gradient + held.gradient, matches.information + held.information)


@dataclass(frozen=True, eq=False)
class Linearised:
    """A problem's residuals at a camera, in units of their deviations and weighed: `jacobian` (6 + F, 2, M) by xi and the free
    lens numbers, `residual` (2, M); and their cost.
    """

    cost: float
    jacobian: FloatArray
    residual: FloatArray


def linearised(camera: CameraUnknowns, problem: JointProblem, kind: FitKind, sigma_px: FloatArray) -> Linearised:
    """`problem` at `camera`, where the residuals across the lines have the deviations `sigma_px` (M,), pixels."""
    r = reproject(camera, problem.matches)
    fixed = {"epipolar": np.inf, "depth": 0.0}
    W = whitening(r, sigma_px, fixed.get(kind, problem.matches.depth_std))
    white = apply(W, r.residual)
    squared = (white**2).sum(0) / SCALE**2
    front = r.points[2] > 0
    cost = float((problem.weights * np.where(front, squared / (1 + squared), 1.0)).sum()) * SCALE**2 / 2
    w = np.sqrt(np.where(front, problem.weights, 0.0)) / (1 + squared)
    return Linearised(cost, r.jacobian(W * w, problem.free), white * w)


def products(jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J^T r (n,) and J^T J (n, n) of a Jacobian (n, 2, M) and residuals (2, M). In blocks too small for BLAS to share among
    threads, which would add up in an order that depends on their number.
    """
    J, r = jacobian.reshape(len(jacobian), -1), residual.reshape(-1)
    blocks = [slice(i, i + BLOCK) for i in range(0, len(r), BLOCK)]
    gradient = sum((J[:, b] @ r[b] for b in blocks), np.zeros(len(J)))
    return gradient, sum((J[:, b] @ J[:, b].T for b in blocks), np.zeros((len(J), len(J))))
