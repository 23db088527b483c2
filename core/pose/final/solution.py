"""What a refinement hands to the verdict: a camera, and how sure the fit that gave it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.camera import FloatArray, Intrinsics, pose_error
from ..search.epipolar import EpipolarFit, refine_epipolar
from ..shared.lens import NAMES, CameraUnknowns, Free, LensPrior
from ..shared.matches import ViewMatches
from .joint import FitKind, JointFit
from .lens_doubt import NO_DOUBT, LensDoubt, doubt

# A direction whose eigenvalue of the information is smaller than this share of the largest one is not determined.
SINGULAR = 1e-13
# The errors of the loop's answer were 5.7 times (RMS) the deviations of its fit, which takes all matches for independent (14
# near starts, final "none").
LOOP_SHARED_ERROR = 5.7


@dataclass(frozen=True, eq=False)
class FittedCamera:
    """`camera`: pose and intrinsics of the image that was matched. `stage`: which fit gave it ("epipolar", "depth", "joint", or
    "loop" where the loop's own answer stands). rms_px: residuals across the epipolar lines, in pixels of the image that was
    matched, whose size is that of the intrinsics. translation_std_units (scene units), rotation_std_deg, lens_std (9,) of the
    numbers `lens.NAMES`: standard deviations with what a lens that was held may be off; infinite where a direction is unseen.
    apart_units, apart_deg: distance between the answers of two halves of the views, scene units and degrees, NaN with fewer
    than four views. solved: what of the lens was solved for; prior: what was known of it; doubt: what speaks against it;
    information (15, 15): what the matches alone know of xi and the lens, None after the loop alone.
    """

    camera: CameraUnknowns
    stage: FitKind | str
    rms_px: float
    translation_std_units: float
    rotation_std_deg: float
    lens_std: FloatArray
    apart_units: float
    apart_deg: float
    prior: LensPrior
    solved: Free = ()
    information: FloatArray | None = None
    doubt: LensDoubt = NO_DOUBT


def from_epipolar(
    fit: EpipolarFit, views: Sequence[ViewMatches], k: Intrinsics, depth: float, prior: LensPrior
) -> FittedCamera:
    """The loop's own answer as a solution. `depth`: median rendered depth, scene units. Nothing is known there of how well the
    focal length of a guess was found.
    """
    apart = (float("nan"), float("nan"))
    if len(views) >= 4:
        a, b = (refine_epipolar(fit.pose, views[i::2], k.matrix).pose for i in (0, 1))
        apart = pose_error(a, b)
    std = LOOP_SHARED_ERROR * deviations(fit.information, depth)
    lens_std = prior.std if prior.calibrated else np.full(len(NAMES), np.inf)
    pose = _pose_deviations(std)
    return FittedCamera(CameraUnknowns(fit.pose, k), "loop", fit.rms_px, *pose, lens_std, *apart, prior)


def from_joint(fit: JointFit, depth: float) -> FittedCamera:
    """The last stage's fit as a solution. `depth`: median rendered depth, scene units."""
    apart = (float("nan"), float("nan"))
    if len(fit.problem.counts) >= 4:
        a, b = fit.halves()
        apart = pose_error(a.pose, b.pose)
    std, problem = deviations(fit.information, depth), fit.problem
    pose, against = _pose_deviations(std), doubt(fit)
    return FittedCamera(
        fit.camera, fit.kind, fit.rms_px, *pose, std[6:], *apart, problem.prior, problem.free, fit.evidence.information, against
    )


def deviations(information: FloatArray, depth: float) -> FloatArray:
    """Standard deviations (n,) from an information (n, n) whose first six are xi; infinite where a direction is not
    determined. `depth`: median depth, scene units.
    """
    # Translations are first expressed as shares of the depth: they are then of the size of angles, and the ratio of eigenvalues
    # means the same in every scene.
    scale = np.ones(len(information))
    scale[:3] = depth
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    if values[0] <= SINGULAR * values[-1]:
        return np.full(len(information), np.inf)
    return np.asarray(scale * np.sqrt((vectors**2 / values).sum(1)))


def _pose_deviations(std: FloatArray) -> tuple[float, float]:
    """Deviations of the centre (scene units) and of the rotation (degrees) from those of xi = (rho, phi): to first order the
    centre moves in the world by -R^T rho.
    """
    return float(np.linalg.norm(std[:3])), float(np.degrees(np.linalg.norm(std[3:6])))
