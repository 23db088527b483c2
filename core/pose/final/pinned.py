"""Points of the scan that somebody pinned to pixels of the photo, as residuals of a fit: alone, or beside the matches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import FloatArray
from ..shared.least_squares import NormalEquations
from ..shared.lens import CameraUnknowns, Free
from .reprojection import Lifted, Reprojection, reproject


@dataclass(frozen=True, eq=False)
class PinnedPoints:
    """N points, in the world, whose pixels in the distorted photo are known to `std_px`; each counts as `weights` (N,) of such
    points. `scale`: of the Geman-McClure loss, in standard deviations; infinite for plain least squares.
    """

    matches: Lifted
    std_px: float
    weights: FloatArray
    scale: float = np.inf

    @classmethod
    def of(
        cls, world: FloatArray, observed: FloatArray, std_px: float, weights: FloatArray, scale: float = np.inf
    ) -> PinnedPoints:
        """`world` (N, 3) scene units, `observed` (N, 2) pixels."""
        points = np.ascontiguousarray(world.T)
        lifted = Lifted(points, np.zeros_like(points), np.zeros(len(world)), np.ascontiguousarray(observed.T))
        return cls(lifted, std_px, weights, scale)

    def __len__(self) -> int:
        return len(self.weights)

    def resized(self, across: float, down: float) -> PinnedPoints:
        """The same in a photo whose pixels are counted `across` and `down` times as many."""
        observed = self.matches.observed * np.array([[across], [down]])
        return replace(
            self, matches=replace(self.matches, observed=observed), std_px=self.std_px * float(np.sqrt(across * down))
        )

    def errors_px(self, camera: CameraUnknowns) -> FloatArray:
        """Distances (N,) of the points from their pixels, as `camera` sees them; infinite behind it."""
        r = reproject(camera, self.matches)
        return np.asarray(np.where(r.points[2] > 0, np.hypot(*r.residual), np.inf))

    def counts(self, camera: CameraUnknowns) -> FloatArray:
        """How much of its weight each point counts (N,): 1 where it lies on its pixel, next to 0 where it is an outlier."""
        return self._loss(reproject(camera, self.matches))[1]

    def equations(self, camera: CameraUnknowns, free: Free) -> NormalEquations:
        """The normal equations of the points by xi, T <- exp(xi) T, and the lens numbers `free`."""
        r = reproject(camera, self.matches)
        cost, counts = self._loss(r)
        whole = np.zeros((2, 2, len(self)))
        whole[0, 0] = whole[1, 1] = np.sqrt(self.weights * counts) / self.std_px
        J = r.jacobian(whole, free).reshape(6 + len(free), -1)
        white = (r.residual * whole[0, 0]).reshape(-1)
        return NormalEquations(float(self.weights @ cost), J @ white, J @ J.T)

    def _loss(self, r: Reprojection) -> tuple[FloatArray, FloatArray]:
        """Cost (N,) of each point and how much it counts (N,). What lies behind the camera costs as much as
        the farthest outlier, or as being a photo away, and pulls at nothing.
        """
        squared = ((r.residual / self.std_px) ** 2).sum(0)
        front = r.points[2] > 0
        if np.isinf(self.scale):
            return np.where(front, squared / 2, FAR**2 / 2), np.where(front, 1.0, 0.0)
        share = squared / self.scale**2
        cost = np.where(front, share / (1 + share), 1.0) * self.scale**2 / 2
        return cost, np.where(front, 1 / (1 + share) ** 2, 0.0)


# Standard deviations that a point behind the camera counts as being off, in plain least squares.
FAR = 1e3
