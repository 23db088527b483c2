"""Pose, and focal length when it is unknown, from matches lifted by the rendered depth (2D-3D), pooled over all views.

The essential matrix of a view needs enough matches in that one view. Three lifted matches of any views make a pose, so that a
start that is too far off for every single view may still lead to the right one. The pose serves as a hypothesis: the stages
after it do not depend on the rendered depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...geometry.camera import FloatArray, Pose
from ...geometry.lie import hat, se3_exp
from ..shared.least_squares import newton_step
from ..shared.matches import ViewMatches, world_points
from ..shared.robust import robust_std

MIN_POINTS = 12
# The limit is wide, because a depth rendered in another view is less accurate than a keypoint.
RANSAC_PX = 6.0
RANSAC_ITERATIONS = 1000
CAP_PX = 8.0
POLISH_STEPS = 20
MIN_SIGMA_PX = 0.5
# Neighbouring factors differ by 8 per cent, and the polish bridges half of that.
FOCAL_SCALES = np.geomspace(0.6, 1.7, 14)


@dataclass(frozen=True)
class ScaledPose:
    """A pose, and the focal length that it holds for as a multiple `scale` of the given one."""

    pose: Pose
    scale: float


def lifted(views: Sequence[ViewMatches]) -> tuple[FloatArray, FloatArray]:
    """World points (N, 3) and ideal image-plane points of the photo (N, 2) of all matches that have a depth."""
    if not views:
        return np.zeros((0, 3)), np.zeros((0, 2))
    points = np.concatenate([world_points(v) for v in views])
    query = np.concatenate([v.query for v in views])
    known = np.isfinite(points).all(axis=1) & (np.concatenate([v.depth for v in views]) > 0)
    return points[known], query[known]


def pnp_pose(views: Sequence[ViewMatches], focal: float, scales: FloatArray | None = None) -> ScaledPose | None:
    """The photo's pose, and its focal length as a multiple of `focal` (pixels); None when the matches hold no pose.

    Without `scales` the focal length is known and the multiple is 1; with them, each is tried and the best one polished.
    """
    points, query = lifted(views)
    if len(points) < MIN_POINTS:
        return None
    options = [
        ScaledPose(pose, float(scale))
        for scale in (scales if scales is not None else (1.0,))
        if (pose := ransac_pose(points, query / scale, RANSAC_PX / focal, RANSAC_ITERATIONS))
    ]
    if not options:
        return None
    best = min(options, key=lambda option: _cost(option, points, query, focal))
    return polish(best, points, query, focal, free_focal=scales is not None)


def ransac_pose(points: FloatArray, observed: FloatArray, tolerance: float, rounds: int) -> Pose | None:
    """The pose under which most `points` (N, 3) fall within `tolerance` of `observed` (N, 2), both in ideal image-plane
    coordinates, after at most `rounds` samples; None where there is no such pose.
    """
    try:
        ok, rotation, translation, _ = cv2.solvePnPRansac(
            np.ascontiguousarray(points, np.float64),
            np.ascontiguousarray(observed, np.float64),
            np.eye(3),
            None,
            iterationsCount=rounds,
            reprojectionError=tolerance,
            confidence=0.999,
            flags=cv2.SOLVEPNP_AP3P,
        )
    except cv2.error:  # OpenCV raises it on degenerate points, which hold no pose.
        return None
    if not ok or not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
        return None
    return Pose(np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(translation, np.float64).ravel())


def _reproject(camera: ScaledPose, points: FloatArray, query: FloatArray, focal: float) -> tuple[FloatArray, FloatArray]:
    """Residuals (N, 2) in pixels and camera-space points (N, 3)."""
    p = camera.pose.transform(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (p[:, :2] / p[:, 2:] * camera.scale - query) * focal, p


def _cost(camera: ScaledPose, points: FloatArray, query: FloatArray, focal: float) -> float:
    """Mean reprojection error in pixels, each counted up to CAP_PX."""
    r, p = _reproject(camera, points, query, focal)
    distance = np.where(p[:, 2] > 0, np.linalg.norm(r, axis=1), CAP_PX)
    return float(np.minimum(distance, CAP_PX).mean())


def polish(camera: ScaledPose, points: FloatArray, query: FloatArray, focal: float, free_focal: bool) -> ScaledPose:
    """Robust least squares (Geman-McClure weights) over the pose and, if free, the logarithm of the focal length."""
    count = 7 if free_focal else 6
    for _ in range(POLISH_STEPS):
        r, p = _reproject(camera, points, query, focal)
        front = p[:, 2] > 0
        r, p = r[front], p[front]
        if len(r) < MIN_POINTS:
            break
        distance = np.linalg.norm(r, axis=1)
        weight = 1 / (1 + (distance / robust_std(distance, MIN_SIGMA_PX)) ** 2) ** 2
        J = _jacobian(p, camera.scale, focal)[:, :, :count]
        H = np.einsum("nij,nik,n->jk", J, J, weight) + 1e-12 * np.eye(count)
        step = newton_step(H, np.einsum("nij,ni,n->j", J, r, weight))
        if step is None:
            break
        grow = float(np.exp(np.clip(step[6], -0.2, 0.2))) if free_focal else 1.0
        camera = ScaledPose(se3_exp(step[:6]) @ camera.pose, camera.scale * grow)
        if np.abs(step).max() < 1e-10:
            break
    return camera


def _jacobian(p: FloatArray, scale: float, focal: float) -> FloatArray:
    """Derivative (N, 2, 7) of the residuals with respect to xi = (rho, phi), T <- exp(xi) T, and log(scale)."""
    z = p[:, 2]
    J = np.zeros((len(p), 2, 7))
    J[:, 0, 0] = J[:, 1, 1] = 1 / z
    J[:, 0, 2], J[:, 1, 2] = -p[:, 0] / z**2, -p[:, 1] / z**2
    J[:, :, 3:6] = -J[:, :, :3] @ hat(p)
    J[:, :, 6] = p[:, :2] / z[:, None]
    return J * (focal * scale)
