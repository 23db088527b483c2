"""The verdict on a pose: trusted, check or failed, with its reasons in words (DESIGN 5).

The thresholds come from `benchmarks/verdict_trials.py` on two real scans: right poses agree with the final render at 40 to 95 %
of the corners (least with 40 % of the photo covered), poses of another place, of a mirrored photo or from a hopeless start at
0 to 22 %.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..camera import FloatArray, Intrinsics, Pose, pose_error
from .epipolar import EpipolarFit, refine_epipolar
from .matches import ViewMatches
from .report import PoseQuality, Verdict
from .verify import FinalView

CELLS = 6

FAILED_AGREEMENT = 0.25
TRUSTED_AGREEMENT = 0.36
MIN_CORNERS = 30
TRUSTED_VIEWS = 4
TRUSTED_INLIERS = 100
TRUSTED_COVERAGE = 0.25
TRUSTED_RMS_PX = 1.0
TRUSTED_DISAGREEMENT = 0.5  # per cent of the median depth
TRUSTED_DISAGREEMENT_DEG = 0.4
SINGULAR = 1e-13  # ratio of the information's eigenvalues below which a direction is unseen
TRUSTED_STD = 0.3  # per cent of the median depth


def assess(fit: EpipolarFit, views: Sequence[ViewMatches], view: FinalView, camera: Intrinsics, depth: float) -> PoseQuality:
    """Gathers the evidence for the pose of `fit`, found from `views`; `depth` is the median rendered depth, scene units."""
    apart, apart_deg = _halves(fit.pose, views, camera.matrix)
    translation, rotation = _deviations(fit, depth)
    return PoseQuality(
        views_used=len(views),
        inliers=sum(len(v) for v in views),
        coverage=_coverage(views, camera),
        epipolar_rms_px=fit.rms_px,
        disagreement=100 * apart / depth,
        disagreement_deg=apart_deg,
        translation_std=100 * translation / depth,
        rotation_std_deg=rotation,
        agreement=view.agreement if view.corners >= MIN_CORNERS else 0.0,
        offset_px=view.offset_px,
        similarity=view.similarity,
        median_depth=depth,
    )


def judge(quality: PoseQuality) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict and its reasons, the decisive one first."""
    q = quality
    share = f"{100 * q.agreement:.0f} % of the photo's corners sit on the render through the refined camera"
    if q.agreement < FAILED_AGREEMENT:
        return "failed", (
            f"Only {share}; the photo may show another place, or the start was too far off: "
            "move the camera closer to the photo's view and refine again.",
        )
    doubts = _doubts(q, share)
    if doubts:
        return "check", tuple(doubts)
    return "trusted", (
        f"{share[0].upper()}{share[1:]} (median offset {q.offset_px:.2f} px).",
        f"{q.inliers} matches in {q.views_used} views agree on the pose to {q.epipolar_rms_px:.2f} px (epipolar RMS).",
        f"Two halves of the views differ by {q.disagreement:.2f} % of the median depth and {q.disagreement_deg:.2f} deg.",
    )


def _doubts(q: PoseQuality, share: str) -> list[str]:
    checks = [
        (q.agreement < TRUSTED_AGREEMENT, f"Only {share}; compare photo and splat by eye."),
        (
            q.views_used < TRUSTED_VIEWS,
            f"Only {q.views_used} rendered views match the photo; start closer to the photo's view.",
        ),
        (q.inliers < TRUSTED_INLIERS, f"Only {q.inliers} matches hold the pose; a sharper photo or a closer start gives more."),
        (
            q.coverage < TRUSTED_COVERAGE,
            f"The matches cover {100 * q.coverage:.0f} % of the photo; the pose may tilt where none are.",
        ),
        (
            q.epipolar_rms_px > TRUSTED_RMS_PX,
            f"The epipolar RMS is {q.epipolar_rms_px:.2f} px; check focal length and distortion.",
        ),
        (
            not (q.disagreement <= TRUSTED_DISAGREEMENT and q.disagreement_deg <= TRUSTED_DISAGREEMENT_DEG),
            f"Two halves of the views differ by {q.disagreement:.2f} % of the median depth and {q.disagreement_deg:.2f} deg.",
        ),
        (
            not q.translation_std <= TRUSTED_STD,
            f"The fit leaves the position uncertain by {q.translation_std:.2f} % of the median depth.",
        ),
    ]
    return [sentence for doubtful, sentence in checks if doubtful]


def _halves(pose: Pose, views: Sequence[ViewMatches], K: FloatArray) -> tuple[float, float]:
    """How far apart (scene units, degrees) the answers of every other view are from those of the rest."""
    if len(views) < 4:
        return float("nan"), float("nan")
    a, b = (refine_epipolar(pose, views[i::2], K).pose for i in (0, 1))
    return pose_error(a, b)


def _deviations(fit: EpipolarFit, depth: float) -> tuple[float, float]:
    """Standard deviation of the centre (scene units) and of the rotation (degrees), from the fit's covariance."""
    # Unit-free first: translations as shares of the depth are of the size of angles, so that singular means singular.
    scale = np.array([depth] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(fit.information * np.outer(scale, scale))
    if values[0] <= SINGULAR * values[-1]:
        return float("inf"), float("inf")
    covariance = (vectors / values) @ vectors.T
    # xi = (rho, phi) moves the centre in the world by -R^T rho to first order.
    return depth * float(np.sqrt(np.trace(covariance[:3, :3]))), float(np.degrees(np.sqrt(np.trace(covariance[3:, 3:]))))


def _coverage(views: Sequence[ViewMatches], camera: Intrinsics) -> float:
    """Share of the photo's CELLS x CELLS cells with at least one match in any view."""
    points = np.concatenate([v.query for v in views]) if views else np.zeros((0, 2))
    pixels = points * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    cells = np.clip((pixels / (camera.width, camera.height) * CELLS).astype(int), 0, CELLS - 1)
    return len(np.unique(cells, axis=0)) / CELLS**2
