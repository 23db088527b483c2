"""What a refinement hands to the verdict: a camera, and how sure the fit that gave it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.camera import FloatArray, Intrinsics, pose_error
from ..search.epipolar import EpipolarFit, refine_epipolar
from ..shared.lens import CameraUnknowns, LensMode
from ..shared.matches import ViewMatches
from .joint import FitKind, JointFit

# A direction whose eigenvalue of the information is smaller than this share of the largest one is not determined.
SINGULAR = 1e-13


@dataclass(frozen=True)
class FittedCamera:
    """`camera`: pose and intrinsics of the image that was matched. `stage`: which fit gave it ("epipolar", "depth", "joint", or
    "loop" where the loop's own answer stands). rms_px: residuals across the epipolar lines, in pixels of the image that was
    matched, whose size is that of the intrinsics. translation_std_units (scene units), rotation_std_deg, focal_std (share of
    the focal length, NaN when it was not solved for): from the fit's covariance, which knows the noise of the matches and
    nothing else; infinite where a direction is unseen. apart_units, apart_deg: distance between the answers of two halves of
    the views, scene units and degrees, NaN with fewer than four views. mode: what of the lens was solved for. lens_gain: by
    what share (0..1) rms_px falls where focal length, k1 and k2 are free; 0 when they were, or after the loop alone.
    """

    camera: CameraUnknowns
    stage: FitKind | str
    rms_px: float
    translation_std_units: float
    rotation_std_deg: float
    focal_std: float
    apart_units: float
    apart_deg: float
    mode: LensMode
    lens_gain: float = 0.0


def from_epipolar(fit: EpipolarFit, views: Sequence[ViewMatches], k: Intrinsics, depth: float, mode: LensMode) -> FittedCamera:
    """The loop's own answer as a solution. `depth`: median rendered depth, scene units."""
    apart = (float("nan"), float("nan"))
    if len(views) >= 4:
        a, b = (refine_epipolar(fit.pose, views[i::2], k.matrix).pose for i in (0, 1))
        apart = pose_error(a, b)
    deviations = _deviations(fit.information, depth)
    return FittedCamera(CameraUnknowns(fit.pose, k), "loop", fit.rms_px, *deviations, *apart, mode)


def from_joint(fit: JointFit, depth: float, lens_gain: float) -> FittedCamera:
    """The last stage's fit as a solution. `depth`: median rendered depth, scene units; `lens_gain`: see `FittedCamera`."""
    apart = (float("nan"), float("nan"))
    if len(fit.problem.counts) >= 4:
        a, b = fit.halves()
        apart = pose_error(a.pose, b.pose)
    translation, rotation, focal = _deviations(fit.information, depth)
    return FittedCamera(fit.camera, fit.kind, fit.rms_px, translation, rotation, focal, *apart, fit.problem.mode, lens_gain)


def _deviations(information: FloatArray, depth: float) -> tuple[float, float, float]:
    """Standard deviations: of the centre (scene units), of the rotation (degrees), of log f (NaN when not free)."""
    # Translations are first expressed as shares of the depth: they are then of the size of angles, and the ratio of eigenvalues
    # means the same in every scene.
    scale = np.ones(len(information))
    scale[:3] = depth
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    free = len(information) > 6
    if values[0] <= SINGULAR * values[-1]:
        return float("inf"), float("inf"), float("inf") if free else float("nan")
    covariance = (vectors / values) @ vectors.T
    # xi = (rho, phi) moves the centre in the world by -R^T rho to first order.
    translation = depth * float(np.sqrt(np.trace(covariance[:3, :3])))
    rotation = float(np.degrees(np.sqrt(np.trace(covariance[3:6, 3:6]))))
    return translation, rotation, float(np.sqrt(covariance[6, 6])) if free else float("nan")
