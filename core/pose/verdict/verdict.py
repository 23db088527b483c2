"""The verdict on a pose: trusted, check or failed, with its reasons in words (docs/design.md, section 5).

The thresholds come from `benchmarks/verdict_trials.py` on two real scans: right poses agree with the final render at 40 to 95 %
of the corners (least with 40 % of the photo covered), poses of another place, of a mirrored photo or from a hopeless start at
0 to 22 %.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry.camera import Intrinsics
from ..final.solution import Solution
from ..report import PoseQuality, Verdict
from ..shared.matches import ViewMatches
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
TRUSTED_STD = 0.5  # per cent of the median depth; twice what the fit itself says, see solution.SHARED_ERROR
TRUSTED_FOCAL_STD = 1.0  # per cent
TRUSTED_LENS_GAIN = 32.0  # per cent; on two scans up to 29 with the right lens, 27 to 59 without its distortion


def assess(solution: Solution, views: Sequence[ViewMatches], seen: FinalView, camera: Intrinsics, depth: float) -> PoseQuality:
    """Gathers the evidence for a solution. `views`: the loop's matches, found without knowing the answer, made with the pinhole
    `camera`; `depth`: the median rendered depth, scene units.
    """
    return PoseQuality(
        views_used=len(views),
        inliers=sum(len(v) for v in views),
        coverage=_coverage(views, camera),
        epipolar_rms_px=solution.rms_px,
        disagreement=100 * solution.apart / depth,
        disagreement_deg=solution.apart_deg,
        translation_std=100 * solution.translation_std / depth,
        rotation_std_deg=solution.rotation_std_deg,
        focal_std=100 * solution.focal_std,
        agreement=seen.agreement if seen.corners >= MIN_CORNERS else 0.0,
        offset_px=seen.offset_px,
        similarity=seen.similarity,
        median_depth=depth,
        lens_gain=100 * solution.lens_gain,
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
        (
            q.focal_std > TRUSTED_FOCAL_STD,  # NaN, when it was not solved for, is no doubt
            f"The fit leaves the focal length uncertain by {q.focal_std:.1f} %; give it, if it is known.",
        ),
        (
            q.lens_gain > TRUSTED_LENS_GAIN,
            f"With focal length and distortion free the matches fit {q.lens_gain:.0f} % better; "
            "check the calibration, or have the lens solved for in full.",
        ),
    ]
    return [sentence for doubtful, sentence in checks if doubtful]


def _coverage(views: Sequence[ViewMatches], camera: Intrinsics) -> float:
    """Share of the photo's CELLS x CELLS cells with at least one match in any view."""
    points = np.concatenate([v.query for v in views]) if views else np.zeros((0, 2))
    pixels = points * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    cells = np.clip((pixels / (camera.width, camera.height) * CELLS).astype(int), 0, CELLS - 1)
    return len(np.unique(cells, axis=0)) / CELLS**2
