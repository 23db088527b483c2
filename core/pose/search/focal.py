"""Focal length search of the loop: from matches lifted by the rendered depth, before the two-view geometry that needs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import FloatArray, Intrinsics
from ..shared.matches import bearings
from .depth_pnp import FOCAL_SCALES, lifted, pnp_pose
from .observe import Observation, PhotoFeatures

# So many lifted matches must land near their pixel before a focal length is believed.
MIN_SUPPORT = 40
SUPPORT_PX = 6.0
# A focal length that differs from the guess by more than this factor is taken for a failure of the fit.
MAX_RATIO = 2.2
# A smaller change (of the logarithm) leaves renders and photo at the same scale, as far as matching is concerned.
SETTLED = 0.04
NEAR_SCALES = np.geomspace(0.9, 1.1, 3)


@dataclass(frozen=True)
class Refocused:
    """The photo under the focal length that was found, the observations' matches likewise, and by what factor it changed."""

    photo: PhotoFeatures
    observations: list[Observation]
    change: float

    @property
    def settled(self) -> bool:
        return abs(float(np.log(self.change))) < SETTLED


def refocus(photo: PhotoFeatures, observations: list[Observation], prior: Intrinsics, first: bool) -> Refocused:
    """Solves pose and focal length together from all lifted matches; unchanged when too few of them agree.

    `first`: nothing is known of the focal length yet, so the whole range of factors is tried instead of those near 1.
    """
    unchanged = Refocused(photo, observations, 1.0)
    views = [o.matches for o in observations]
    focal = photo.pinhole.focal
    solved = pnp_pose(views, focal, FOCAL_SCALES if first else NEAR_SCALES)
    if solved is None:
        return unchanged
    scale, (points, observed) = solved.scale, lifted(views)
    p = solved.pose.transform(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(p[:, :2] / p[:, 2:] * scale - observed, axis=1) * focal
    ratio = scale * focal / prior.focal
    if ((error < SUPPORT_PX) & (p[:, 2] > 0)).sum() < MIN_SUPPORT or not 1 / MAX_RATIO < ratio < MAX_RATIO:
        return unchanged
    old = photo.image.intrinsics
    new = replace(old, fx=old.fx * scale, fy=old.fy * scale)
    return Refocused(photo.with_intrinsics(new), renormalised(observations, old, new), scale)


def renormalised(observations: Sequence[Observation], old: Intrinsics, new: Intrinsics) -> list[Observation]:
    """The same observations with the photo's ideal coordinates taken under another lens."""

    def again(points: FloatArray) -> FloatArray:
        return new.normalise(old.project(bearings(points)))

    return [replace(o, matches=replace(o.matches, query=again(o.matches.query))) for o in observations]
