"""Coarse stage: the pose on which the two-view answers of all rendered views agree (paper: multi-view consistency).

Each view s says x_q = R_qs x_s + s_s t_qs, hence R^ = R_qs R_s and a ray from the view's centre that holds the photo's centre:
c^ = c_s - s_s (R_qs R_s)^T t_qs, s_s > 0. This is the paper's residual R^^-1 (R_qs t_s + s_s t_qs - t^) with the world's
origin moved to the views: there t = -R c is small, so that the error of a view's rotation is not multiplied by its distance
from an arbitrary origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...geometry.camera import FloatArray, Pose, rotation_angle_deg
from ...geometry.lie import so3_exp, so3_log
from .two_view import TwoViewPose

IRLS_ROUNDS = 10
# The robust scales have a floor: below the noise of a view, the weights would follow a single view.
MIN_ROTATION_SCALE_RAD = 2e-4
MIN_DIRECTION_SCALE_RAD = 2e-3
# Two rays that are closer to parallel than this do not determine a centre.
MIN_RAY_ANGLE_DEG = 1.0


@dataclass(frozen=True, eq=False)
class Consensus:
    """Coarse pose, the distances s_s (V,) along each view's ray (scene units), and the robust weight (V,) 0..1 of each view."""

    pose: Pose
    scales: FloatArray
    weights: FloatArray


def consensus_pose(views: Sequence[Pose], relative: Sequence[TwoViewPose], support: FloatArray) -> Consensus | None:
    """The pose that the views' answers share, or None when fewer than two views fix its scale.

    `views` are the rendered poses, `relative` their two-view answers, `support` (V,) the number of inliers of each.
    """
    if len(views) < 2:
        return None
    absolute = [rel.R @ view.R for view, rel in zip(views, relative, strict=True)]
    rotation, rotation_weights = _mean_rotation(absolute, support)
    centres = np.array([view.centre for view in views])
    # Each ray is turned into the world by its own view's rotation, so that it does not depend on the other views.
    rays = np.array([-R.T @ rel.t for R, rel in zip(absolute, relative, strict=True)])
    solved = _intersect_rays(centres, rays, support * rotation_weights)
    if solved is None:
        return None
    centre, weights = solved
    scales = np.einsum("ij,ij->i", centre - centres, rays)
    return Consensus(Pose.from_centre(rotation, centre), scales, weights * rotation_weights)


def _mean_rotation(rotations: Sequence[FloatArray], support: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Robust mean on SO(3) (Cauchy weights, started from the rotation nearest to all others)."""
    angles = np.array([[np.radians(rotation_angle_deg(a.T @ b)) for b in rotations] for a in rotations])
    start = int(np.argmin([np.sort(row)[: len(row) // 2 + 1].sum() for row in angles]))
    mean, weights = rotations[start], np.ones(len(rotations))
    for _ in range(IRLS_ROUNDS):
        errors = np.array([so3_log(mean.T @ R) for R in rotations])
        norms = np.linalg.norm(errors, axis=1)
        scale = max(MIN_ROTATION_SCALE_RAD, 1.5 * float(np.median(norms)))
        weights = 1 / (1 + (norms / scale) ** 2)
        w = weights * support
        step = (w[:, None] * errors).sum(0) / w.sum()
        mean = np.asarray(mean @ so3_exp(step))
        if np.linalg.norm(step) < 1e-10:
            break
    return mean, weights


def _intersect_rays(centres: FloatArray, rays: FloatArray, support: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Robust point nearest to all rays: started from the pair with the least median angle, then reweighted least squares."""
    best, best_score = None, np.inf
    for i, j in combinations(range(len(centres)), 2):
        if np.linalg.norm(np.cross(rays[i], rays[j])) < np.sin(np.radians(MIN_RAY_ANGLE_DEG)):
            continue
        pair = [i, j]
        centre = _nearest_point(centres[pair], rays[pair], np.ones(2))
        angles = _ray_angles(centre, centres, rays)
        order = np.argsort(angles)
        mass = np.cumsum(support[order])
        score = float(angles[order][np.searchsorted(mass, 0.6 * mass[-1])])
        if score < best_score:
            best, best_score = centre, score
    if best is None:
        return None
    centre, weights = best, np.ones(len(rays))
    for _ in range(IRLS_ROUNDS):
        angles = _ray_angles(centre, centres, rays)
        scale = max(MIN_DIRECTION_SCALE_RAD, 1.5 * float(np.median(angles)))
        weights = 1 / (1 + (angles / scale) ** 2)
        distance = np.maximum(np.linalg.norm(centre - centres, axis=1), 1e-3 * np.linalg.norm(centre - centres, axis=1).max())
        # The deviation of a ray grows with its length: dividing by it turns scene units into an angle.
        centre = _nearest_point(centres, rays, support * weights / distance**2)
    return centre, weights


def _nearest_point(centres: FloatArray, rays: FloatArray, weights: FloatArray) -> FloatArray:
    """Least-squares point (3,) nearest to the lines centres + s rays; s is eliminated by the projector across each ray."""
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    A = np.einsum("i,ijk->jk", weights, across)
    b = np.einsum("i,ijk,ik->j", weights, across, centres)
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])


def _ray_angles(centre: FloatArray, centres: FloatArray, rays: FloatArray) -> FloatArray:
    """Angle (V,), radians, between each ray and the direction to `centre`; a point behind a view is at more than pi/2."""
    to = centre - centres
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(rays, to), axis=1), np.einsum("ij,ij->i", rays, to)))
