"""The verdict on a pose: trusted, check or failed, with its reasons in words (docs/design.md, section 5).

The thresholds come from `benchmarks/verdict_trials.py` on two real scans: right poses agree with the final render at 40 to 95 %
of the corners (least with 40 % of the photo covered), poses of another place, of a mirrored photo or from a hopeless start at
0 to 22 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import Intrinsics, Pose
from ..final.solution import FittedCamera
from ..report import PoseQuality, Verdict
from ..shared.corners import filled_cells
from ..shared.matches import ViewMatches
from . import sentences
from .verify import FinalView

CELLS = 6

# With fewer corners of the photo over the splat, right poses cannot be told from wrong ones.
MIN_CORNERS = 30
# With fewer than this, not even perfect agreement supports a pose.
FEWEST_CORNERS = 10
FAILED_AGREEMENT = 0.25
TRUSTED_AGREEMENT = 0.36
TRUSTED_VIEWS = 4
TRUSTED_INLIERS = 100
TRUSTED_COVERAGE = 0.25
# In pixels of the photo, reduced to a long side of RMS_LONG_SIDE_PX where it is larger.
TRUSTED_RMS_PX = 1.0
RMS_LONG_SIDE_PX = 1280
# Per cent of the median depth.
TRUSTED_DISAGREEMENT_PCT = 0.5
TRUSTED_DISAGREEMENT_DEG = 0.4
# Per cent of the median depth.
TRUSTED_STD_PCT = 0.5
TRUSTED_FOCAL_STD_PCT = 1.0
# The matches must make a lens that was given at least e^7 times likelier than another one that would move the camera.
TRUSTED_LENS_LOG_ODDS = -7.0


@dataclass(frozen=True)
class LoopMatches:
    """The loop's matches, found without knowing the answer: of each view, made with the intrinsics `pinhole`; and the median
    rendered depth there, scene units.
    """

    views: Sequence[ViewMatches]
    pinhole: Intrinsics
    median_depth: float


def assess(solution: FittedCamera, loop: LoopMatches, final: FinalView, photo: Intrinsics) -> PoseQuality:
    """Gathers the evidence for a solution. `photo`: the camera of the photo at its full size."""
    depth = loop.median_depth
    pose, matched = solution.camera.pose, solution.camera.intrinsics
    photo_px = max(photo.width, photo.height) / max(matched.width, matched.height)
    return replace(
        _render_evidence(pose, final, photo, depth),
        of="refined",
        views_used=len(loop.views),
        inliers=sum(len(v) for v in loop.views),
        coverage=_coverage(loop.views, loop.pinhole),
        rms_px_of_photo=photo_px * solution.rms_px,
        disagreement_pct=100 * solution.apart_units / depth,
        disagreement_deg=solution.apart_deg,
        translation_std_pct=100 * solution.translation_std_units / depth,
        rotation_std_deg=solution.rotation_std_deg,
        focal_std_pct=100 * float(solution.lens_std[0]),
        lens_log_odds=solution.doubt.log_odds,
        lens_shift_pct=100 * solution.doubt.shift_units / depth,
        lens_shift_deg=solution.doubt.shift_deg,
    )


def assess_start(pose: Pose, final: FinalView, photo: Intrinsics, depth: float) -> PoseQuality:
    """The evidence for a start camera that is kept: what the splat rendered through it shows, for no fit had a part in it."""
    return _render_evidence(pose, final, photo, depth)


def _render_evidence(pose: Pose, final: FinalView, photo: Intrinsics, depth: float) -> PoseQuality:
    """The part of the evidence that the final render alone gives."""
    return PoseQuality(
        of="start",
        pose=pose,
        photo_long_side_px=max(photo.width, photo.height),
        median_depth=depth,
        corners=final.corners,
        agreement=final.agreement,
        offset_px_of_photo=final.offset_px_of_photo,
        similarity=final.similarity,
    )


def judge(quality: PoseQuality) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on a pose that was found, and its reasons in plain words, the decisive one first."""
    q = quality
    few = q.corners < MIN_CORNERS
    if few and (q.corners < FEWEST_CORNERS or q.agreement < TRUSTED_AGREEMENT):
        return "failed", (sentences.too_few_corners(q),)
    if not q.agreement >= FAILED_AGREEMENT:
        return "failed", (sentences.another_place(q),)
    doubts = _doubts(q)
    return ("check", tuple(doubts)) if doubts else ("trusted", sentences.trusted(q))


def _doubts(q: PoseQuality) -> list[str]:
    # A comparison with NaN, which stands for an unknown figure, is false. Where an unknown figure is a reason for doubt, the
    # test is therefore written `not <=`.
    apart = q.disagreement_pct <= TRUSTED_DISAGREEMENT_PCT and q.disagreement_deg <= TRUSTED_DISAGREEMENT_DEG
    checks = [
        (q.corners < MIN_CORNERS, sentences.few_corners),
        (q.agreement < TRUSTED_AGREEMENT, sentences.fits_in_part),
        (q.views_used < TRUSTED_VIEWS, sentences.few_views),
        (q.inliers < TRUSTED_INLIERS, sentences.few_matches),
        (not q.coverage >= TRUSTED_COVERAGE, sentences.uncovered),
        (not rms_px(q) <= TRUSTED_RMS_PX, sentences.views_apart),
        (not apart, sentences.halves_apart),
        (not q.translation_std_pct <= TRUSTED_STD_PCT, sentences.place_uncertain),
        (not q.focal_std_pct <= TRUSTED_FOCAL_STD_PCT, sentences.focal_uncertain),
        (_may_be_other_lens(q), sentences.other_lens),
    ]
    return [sentence(q) for doubtful, sentence in checks if doubtful]


def _may_be_other_lens(q: PoseQuality) -> bool:
    """Whether the lens as it was given is not confirmed, and another one would put the camera elsewhere."""
    moves = q.lens_shift_pct > TRUSTED_DISAGREEMENT_PCT or q.lens_shift_deg > TRUSTED_DISAGREEMENT_DEG
    return moves and not q.lens_log_odds <= TRUSTED_LENS_LOG_ODDS


def rms_px(q: PoseQuality) -> float:
    """The RMS in the unit of TRUSTED_RMS_PX, whatever size the photo has and was matched at."""
    return q.rms_px_of_photo * min(1.0, RMS_LONG_SIDE_PX / q.photo_long_side_px)


def fits_better(start: FinalView, refined: FinalView, margin: float) -> bool:
    """Whether the start camera sits on the photo better than the refined one by `margin` (share of the corners), as far as
    there are enough corners to tell.
    """
    return start.corners >= MIN_CORNERS and start.agreement > refined.agreement + margin


def _coverage(views: Sequence[ViewMatches], pinhole: Intrinsics) -> float:
    """Share of the photo's CELLS x CELLS cells with at least one match in any view."""
    points = np.concatenate([v.query for v in views]) if views else np.zeros((0, 2))
    return filled_cells(pinhole.to_pixels(points), (pinhole.width, pinhole.height), CELLS) / CELLS**2
