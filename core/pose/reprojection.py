"""Reprojection of matches lifted by the rendered depth, each weighed by what its depth does to the predicted pixel.

A match says: the photo's pixel q shows what the rendered view s sees along a ray at depth d, known to sigma_d. Moving d moves
the predicted pixel u(d) along the epipolar line, J = du/dd. Across that line the residual u - q has deviation sigma_px (that is
the epipolar constraint of the paper), along it sqrt(sigma_px^2 + |J|^2 sigma_d^2) (that is the depth). An infinite sigma_d
leaves the paper's stage, zero leaves PnP.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..camera import FloatArray, Intrinsics
from ..lie import hat
from .lens import LensCamera
from .matches import ViewMatches, bearings

MIN_SIGMA_PX = 0.15  # no match is known better than a keypoint is
MIN_LENGTH = 1e-12


@dataclass(frozen=True)
class Reprojection:
    """Of M matches, in pixels of the distorted photo.

    residual (M, 2): predicted minus observed; jacobian (M, 2, 6 + F) by xi = (rho, phi), T <- exp(xi) T, then the F free lens
    numbers (`lens.NAMES`); along (M, 2): du/dd, pixels per scene unit; z (M,): depth of the point from the photo.
    """

    residual: FloatArray
    jacobian: FloatArray
    along: FloatArray
    z: FloatArray

    def sides(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Unit direction of the line (M, 2), |du/dd| (M,), and the residual along and across the line (M,)."""
        length = np.linalg.norm(self.along, axis=1)
        e = self.along / np.maximum(length, MIN_LENGTH)[:, None]
        r = self.residual
        return e, length, (r * e).sum(1), r[:, 1] * e[:, 0] - r[:, 0] * e[:, 1]


def reproject(camera: LensCamera, matches: ViewMatches, seen: FloatArray, free: int = 0) -> Reprojection:
    """`seen` (M, 2): the matches' pixels in the distorted photo. `free`: how many lens numbers the Jacobian holds (0..5)."""
    k, pose = camera.intrinsics, camera.pose
    R = pose.R @ matches.pose.R.T
    ray = bearings(matches.view) @ R.T
    p = ray * matches.depth[:, None] + (pose.t - R @ matches.pose.t)
    z = np.where(np.abs(p[:, 2]) > MIN_LENGTH, p[:, 2], MIN_LENGTH)
    n = p[:, :2] / z[:, None]
    bent = k.distort_normalised(n)
    focal = np.array([k.fx, k.fy])
    D = _pixel_jacobian(k, n, z)
    J = np.zeros((len(p), 2, 6 + free))
    J[:, :, :3] = D
    J[:, :, 3:6] = -D @ hat(p)
    if free:
        r2 = (n * n).sum(1)[:, None]
        columns = (bent * focal, n * r2 * focal, n * r2 * r2 * focal, [k.focal, 0.0], [0.0, k.focal])
        for i, column in enumerate(columns[:free]):
            J[:, :, 6 + i] = column
    return Reprojection(bent * focal + (k.cx, k.cy) - seen, J, np.einsum("nij,nj->ni", D, ray), p[:, 2])


def _pixel_jacobian(k: Intrinsics, n: FloatArray, z: FloatArray) -> FloatArray:
    """Derivative (M, 2, 3) of the distorted pixel by the camera-space point."""
    D = np.zeros((len(n), 2, 3))
    D[:, 0, 0] = D[:, 1, 1] = 1 / z
    D[:, :, 2] = -n / z[:, None]
    if k.has_distortion:
        xx, xy, yy = k.distortion_jacobian(n)
        D = np.stack([np.stack([xx, xy], 1), np.stack([xy, yy], 1)], 1) @ D
    return np.asarray(D * np.array([k.fx, k.fy])[:, None])


def whiten(r: Reprojection, sigma_px: float, sigma_depth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (M, 2) and Jacobian (M, 2, n) in units of their deviation: across the line, then along it.

    `sigma_depth` (M,), scene units, may be infinite: then the component along the line says nothing.
    """
    e, length, _, _ = r.sides()
    with np.errstate(invalid="ignore"):
        sigma_along = np.hypot(sigma_px, np.where(length > MIN_LENGTH, length * sigma_depth, 0.0))
    across = np.stack([-e[:, 1], e[:, 0]], 1) / sigma_px
    along = e / sigma_along[:, None]
    W = np.stack([across, along], 1)
    flat = length <= MIN_LENGTH  # no line at zero baseline: the depth moves nothing, and both directions count alike
    W[flat] = np.eye(2) / sigma_px
    return np.einsum("nij,nj->ni", W, r.residual), W @ r.jacobian


def robust_across_px(r: Reprojection) -> float:
    """Deviation of the residuals across the line (1.4826 median), with a floor, pixels."""
    across = np.abs(r.sides()[3])
    return max(MIN_SIGMA_PX, 1.4826 * float(np.median(across))) if len(across) else MIN_SIGMA_PX
