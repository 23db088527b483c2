"""Reprojection of matches lifted by the rendered depth, each weighed by what its depth does to the predicted pixel.

A match says: the photo's pixel q shows what the rendered view s sees along a ray at depth d, known to sigma_d. Moving d moves
the predicted pixel u(d) along the epipolar line, J = du/dd. Across that line the residual u - q has deviation sigma_px (that is
the epipolar constraint of the paper), along it sqrt(sigma_px^2 + |J|^2 sigma_d^2) (that is the depth). An infinite sigma_d
leaves the paper's stage, zero leaves PnP.

The matches of all views are one set of arrays with the components first, (2, M) and (3, M): every operation then runs over
contiguous memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.camera import FloatArray
from ..shared.lens import CameraUnknowns, Free
from ..shared.matches import BoolArray, ViewMatches, bearings, world_points

MIN_DEPTH = 1e-12
# Pixels per scene unit: a shorter derivative is what rounding leaves of none at all.
MIN_LENGTH = 1e-9


@dataclass(frozen=True, eq=False)
class Lifted:
    """M matches of any number of views, in the world.

    points (3, M): lifted by the rendered depth; rays (3, M): how they move per unit of depth; depth_std (M,), scene units;
    observed (2, M): pixels in the distorted photo.
    """

    points: FloatArray
    rays: FloatArray
    depth_std: FloatArray
    observed: FloatArray

    @classmethod
    def of(cls, views: Sequence[ViewMatches], observed: Sequence[FloatArray]) -> Lifted:
        """The matches of the views one after the other; `observed` (M_v, 2) of each."""
        points = np.concatenate([world_points(v) for v in views])
        rays = np.concatenate([bearings(v.view) @ v.pose.R for v in views])
        depth_std = np.concatenate([v.depth_std for v in views])
        return cls(*map(np.ascontiguousarray, (points.T, rays.T, depth_std, np.concatenate(observed).T)))

    def take(self, keep: BoolArray) -> Lifted:
        """The matches where `keep` (M,) is True."""
        return Lifted(self.points[:, keep], self.rays[:, keep], self.depth_std[keep], self.observed[:, keep])


@dataclass(frozen=True, eq=False)
class Reprojection:
    """Of M matches, in pixels of the distorted photo.

    residual (2, M): predicted minus observed; along (2, M): du/dd, pixels per scene unit; points (3, M), ideal (2, M): in the
    photo's camera space and image plane; slope (2, 2, M): slope[j, i] is the derivative of pixel i by the point's component
    j = 0, 1.
    """

    camera: CameraUnknowns
    residual: FloatArray
    along: FloatArray
    points: FloatArray
    ideal: FloatArray
    slope: FloatArray

    @property
    def across(self) -> FloatArray:
        """The residuals across the lines (M,), signed."""
        (x, y), r = self.along, self.residual
        return np.asarray((r[1] * x - r[0] * y) / np.maximum(_length(self.along), MIN_LENGTH))

    def jacobian(self, W: FloatArray, free: Free = ()) -> FloatArray:
        """Derivative (6 + F, 2, M) of the residuals by xi = (rho, phi), T <- exp(xi) T, then the F lens numbers `free`,
        multiplied by `W` (2, 2, M), as `whitening` gives it.
        """
        n, (x, y, z) = self.ideal, self.points
        J = np.empty((6 + len(free), 2, n.shape[1]))
        J[0], J[1] = (apply(W, column) for column in self.slope)
        J[2] = -(n[0] * J[0] + n[1] * J[1])
        J[3], J[4], J[5] = y * J[2] - z * J[1], z * J[0] - x * J[2], x * J[1] - y * J[0]
        for i, number in enumerate(free):
            J[6 + i] = apply(W, self._by_lens(number))
        return J

    def _by_lens(self, number: int) -> FloatArray:
        """Derivative (2, M), or (2, 1) where it is the same for all, of the pixels by one lens number, by its place in
        `lens.NAMES`.
        """
        k, (x, y) = self.camera.intrinsics, self.ideal
        focal = np.array([[k.fx], [k.fy]])
        if number in (0, 8):
            distorted = focal * k.distort_normalised(self.ideal.T).T
            return np.asarray(distorted if number == 0 else np.array([[0.5], [-0.5]]) * distorted)
        if number in (1, 2):
            return np.array([[k.focal], [0.0]]) if number == 1 else np.array([[0.0], [k.focal]])
        r2 = x * x + y * y
        if number in (5, 6):
            twice = 2 * x * y
            return np.asarray(focal * ([twice, r2 + 2 * y * y] if number == 5 else [r2 + 2 * x * x, twice]))
        return np.asarray(focal * self.ideal * r2 ** {3: 1, 4: 2, 7: 3}[number])


def reproject(camera: CameraUnknowns, matches: Lifted) -> Reprojection:
    """Where `camera` sees the matches' points, against where the photo shows them."""
    k, R = camera.intrinsics, camera.pose.R
    p, ray = R @ matches.points + camera.pose.t[:, None], R @ matches.rays
    z = np.where(np.abs(p[2]) > MIN_DEPTH, p[2], MIN_DEPTH)
    n = p[:2] / z
    slope = np.zeros((2, 2, len(z)))
    if k.has_distortion:
        distorted = k.distort_normalised(n.T).T
        slope[0, 0], slope[0, 1], slope[1, 1] = k.distortion_jacobian(n.T)
        slope[1, 0] = slope[0, 1]
    else:
        distorted = n
        slope[0, 0] = slope[1, 1] = 1.0
    focal = np.array([[k.fx], [k.fy]])
    slope *= focal / z
    residual = focal * distorted + [[k.cx], [k.cy]] - matches.observed
    return Reprojection(camera, residual, apply(slope, ray[:2] - n * ray[2]), p, n, slope)


def apply(A: FloatArray, v: FloatArray) -> FloatArray:
    """Products (2, M) of the 2x2 matrices whose columns are A[0], A[1] (2, M) with the vectors `v` (2, M)."""
    return np.asarray(A[0] * v[0] + A[1] * v[1])


def _length(v: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(v[0] ** 2 + v[1] ** 2))


def whitening(r: Reprojection, sigma_px: FloatArray | float, sigma_depth: FloatArray | float) -> FloatArray:
    """Matrices W (2, 2, M), W[j] their column j, that bring residuals to units of their deviation: across the line first, then
    along it.

    `sigma_px` and `sigma_depth` (scene units): one or (M,). An infinite `sigma_depth` lets the component along say nothing.
    """
    length = _length(r.along)
    # At zero baseline there is no line: the depth moves nothing, and both directions count alike.
    flat = length <= MIN_LENGTH
    e = np.where(flat, [[0.0], [-1.0]], r.along / np.maximum(length, MIN_LENGTH))
    with np.errstate(invalid="ignore"):
        spread = np.where(flat, 0.0, length * sigma_depth)
    along = e / np.sqrt(sigma_px**2 + spread**2)
    across = e / sigma_px
    return np.array([[-across[1], along[0]], [across[0], along[1]]])
