"""Two-view geometry of the photo and one rendered view: essential matrix by robust sampling, then R and the direction of t.

x_q = R_qs x_s + s t_qs with |t_qs| = 1 and unknown s > 0 (paper: relative pose up to scale).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...geometry.camera import FloatArray
from ..shared.matches import BoolArray, ViewMatches, bearings

# OpenCV's samplers raise or return nonsense below 5 matches; 8 leave some that check the 5-point fit.
MIN_MATCHES = 8
# With OpenCV's default of 1000 iterations, pairs of distant views are lost.
MAX_RANSAC_ITERATIONS = 10_000
CONFIDENCE = 0.999
# A valid essential matrix has a norm of about 1; OpenCV's USAC returns 1e22 for degenerate points.
MAX_ESSENTIAL_NORM = 1e3


@dataclass(frozen=True, eq=False)
class TwoViewPose:
    """R_qs (3, 3), unit t_qs (3,), and the inliers (M,) among the matches it was found from."""

    R: FloatArray
    t: FloatArray
    inliers: BoolArray


def two_view_pose(matches: ViewMatches, threshold: float) -> TwoViewPose | None:
    """Relative pose of view and photo, or None when the matches do not hold one.

    `threshold` is the epipolar distance in image-plane units (pixels / focal length) up to which a match is an inlier.
    """
    if len(matches) < MIN_MATCHES:
        return None
    found = _essential(matches, threshold, cv2.USAC_MAGSAC)
    if found is None or found[1].sum() < 0.5 * len(matches):
        # Where the first sampler finds few inliers, the second one often finds the pair of distant views that the first one
        # lost.
        other = _essential(matches, threshold, cv2.USAC_ACCURATE)
        if other is not None and (found is None or other[1].sum() > found[1].sum()):
            found = other
    if found is None or found[1].sum() < MIN_MATCHES:
        return None
    E, inliers = found
    return _decompose(E, matches, inliers)


def _essential(matches: ViewMatches, threshold: float, method: int) -> tuple[FloatArray, BoolArray] | None:
    """Essential matrix E (3, 3) with x_q^T E x_s = 0 and its inliers (M,)."""
    try:
        E, mask = cv2.findEssentialMat(
            matches.view,
            matches.query,
            np.eye(3),
            method=method,
            prob=CONFIDENCE,
            threshold=threshold,
            maxIters=MAX_RANSAC_ITERATIONS,
        )
    except cv2.error:  # raised on degenerate point sets; they hold no pose
        return None
    if E is None or mask is None or E.shape != (3, 3) or not np.isfinite(E).all() or np.linalg.norm(E) > MAX_ESSENTIAL_NORM:
        return None
    return np.asarray(E, np.float64), mask.ravel().astype(bool)


def _decompose(E: FloatArray, matches: ViewMatches, inliers: BoolArray) -> TwoViewPose | None:
    """The one of E's four poses with most inliers in front of both cameras.

    cv2.recoverPose drops points farther than 50 baselines, which would be nearly all of them for a narrow fan of views.
    """
    R1, R2, t = cv2.decomposeEssentialMat(E)
    t = np.asarray(t, np.float64).ravel()
    q, s = bearings(matches.query[inliers]), bearings(matches.view[inliers])
    options = [(np.asarray(R, np.float64), sign * t) for R in (R1, R2) for sign in (1.0, -1.0)]
    front = [int(in_front(R, direction, q, s).sum()) for R, direction in options]
    best = int(np.argmax(front))
    if front[best] < MIN_MATCHES // 2:
        return None
    return TwoViewPose(*options[best], inliers)


def in_front(R: FloatArray, t: FloatArray, q: FloatArray, s: FloatArray) -> BoolArray:
    """Which points (N,) lie in front of both cameras, x_q = R x_s + t, for rays q, s (N, 3)."""
    r = s @ R.T
    # Least-squares depths a, b of a q = b r + t, from the 2x2 normal equations of each pair of rays.
    qq, rr, qr = (q * q).sum(1), (r * r).sum(1), (q * r).sum(1)
    qt, rt = q @ t, r @ t
    det = qq * rr - qr * qr
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (rr * qt - qr * rt) / det, (qr * qt - qq * rt) / det
    return np.asarray((a > 0) & (b > 0))
