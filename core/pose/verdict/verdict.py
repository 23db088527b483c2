"""The verdict on a pose: trusted, check or failed, with its reasons in words (docs/design.md, section 5).

Whether the render sits on the photo is judged by the regions in which it does (`regions.py`), because corners on things that
the scan does not have are no evidence against a pose. Their thresholds come from `benchmarks/agreement.py`, the others from
`benchmarks/verdict_trials.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.camera import Intrinsics, Pose, pose_error
from ..final.solution import FittedCamera
from ..report import PoseQuality, Verdict
from ..shared.corners import filled_cells
from ..shared.matches import ViewMatches
from . import sentences
from .verify import FinalView

CELLS = 6

# With fewer corners of the photo over the splat, right poses cannot be told from wrong ones.
MIN_CORNERS = 30
# The render sits on a part of the photo with at least so many corners in place, over such a share of the photo, to so many
# pixels. Smaller parts support no pose; parts that leave no doubt are larger.
SITS_CORNERS, SITS_AREA, SITS_OFFSET_PX = 12, 0.005, 1.0
TRUSTED_CORNERS, TRUSTED_AREA, TRUSTED_OFFSET_PX = 40, 0.08, 0.75
# And with at least so many times the corners that chance would leave in place over the whole photo.
BEYOND_CHANCE = 2.0
# Where fewer than this share of the corners there are in place, and less exactly than to so many pixels, the part is a weak
# one: a mirrored photo matches the back of a wallpaper with 39 % to 0.6 px.
WEAK_SHARE, WEAK_OFFSET_PX = 0.45, 0.5
# All in pixels of the photo, reduced to this long side where it is larger.
OFFSET_LONG_SIDE_PX = 640
# A right pose at which fewer patches than this are shown best in their place is of a place that repeats itself.
TRUSTED_UNRIVALLED = 0.7
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
# The matches must make a lens that was given at least e^10 times likelier than another one that would move the camera.
TRUSTED_LENS_LOG_ODDS = -10.0


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
        lens_focal_pct=100 * solution.doubt.focal_change,
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
        region_corners=final.region.corners,
        region_share=final.region.share,
        region_expected=final.region.expected,
        region_area=final.region.area,
        region_offset_px_of_photo=final.photo_px * final.region.offset_px,
        unrivalled=final.region.unrivalled,
    )


def judge(quality: PoseQuality) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on a pose that was found, and its reasons in plain words, the decisive one first."""
    q = quality
    held = q.views_used >= TRUSTED_VIEWS and q.inliers >= TRUSTED_INLIERS
    if not _sits(q, SITS_CORNERS, SITS_AREA, SITS_OFFSET_PX) or (_weak(q) and not held):
        sentence = sentences.too_few_corners if q.corners < MIN_CORNERS else sentences.another_place
        return "failed", (sentence(q),)
    doubts = _doubts(q)
    return ("check", tuple(doubts)) if doubts else ("trusted", sentences.trusted(q))


def _sits(q: PoseQuality, corners: int, area: float, offset_px: float) -> bool:
    """Whether the render sits on a part of the photo with at least so many corners in place, far more than by chance, over such
    a share of the photo, to `offset_px`.
    """
    enough = q.region_corners >= max(corners, BEYOND_CHANCE * q.region_expected)
    return enough and q.region_area >= area and _offset_px(q) <= offset_px


def _weak(q: PoseQuality) -> bool:
    """Whether the part that sits is no evidence by itself, but only together with the matches that hold the camera."""
    return not (q.region_share >= WEAK_SHARE or _offset_px(q) <= WEAK_OFFSET_PX)


def _offset_px(q: PoseQuality) -> float:
    """The offset where the render sits, in the unit of SITS_OFFSET_PX."""
    return q.region_offset_px_of_photo * min(1.0, OFFSET_LONG_SIDE_PX / q.photo_long_side_px)


def sits_well(q: PoseQuality) -> bool:
    """Whether the render sits on so much of the photo that this leaves no doubt."""
    return _sits(q, TRUSTED_CORNERS, TRUSTED_AREA, TRUSTED_OFFSET_PX) and not _weak(q)


def is_unsettled(verdict: Verdict, quality: PoseQuality | None) -> bool:
    """Whether there is a camera, and a doubt about it that other views of the splat may settle: the answer may be a wrong one,
    or too few views or matches hold it. What the photo itself lacks, or its lens, no views can mend.
    """
    q = quality
    if q is None or verdict == "trusted":
        return False
    agree = Apart(q.disagreement_pct, q.disagreement_deg).is_same
    return q.of != "refined" or not sits_well(q) or not agree or q.views_used < TRUSTED_VIEWS or q.inliers < TRUSTED_INLIERS


@dataclass(frozen=True)
class Apart:
    """How far apart two cameras of one photo are: per cent of the median depth, degrees."""

    distance_pct: float
    degrees: float

    @classmethod
    def of(cls, one: PoseQuality, other: PoseQuality) -> Apart:
        distance, degrees = pose_error(one.pose, other.pose)
        return cls(100 * distance / one.median_depth, degrees)

    @property
    def is_same(self) -> bool:
        """Whether they are no farther apart than two halves of the views of a trusted one may be."""
        return self.distance_pct <= TRUSTED_DISAGREEMENT_PCT and self.degrees <= TRUSTED_DISAGREEMENT_DEG


def _doubts(q: PoseQuality) -> list[str]:
    # A comparison with NaN, which stands for an unknown figure, is false. Where an unknown figure is a reason for doubt, the
    # test is therefore written `not <=`.
    checks = [
        (q.corners < MIN_CORNERS, sentences.few_corners),
        (not sits_well(q), sentences.fits_in_part),
        (not q.unrivalled >= TRUSTED_UNRIVALLED, sentences.repeats),
        (q.views_used < TRUSTED_VIEWS, sentences.few_views),
        (q.inliers < TRUSTED_INLIERS, sentences.few_matches),
        (not q.coverage >= TRUSTED_COVERAGE, sentences.uncovered),
        (not rms_px(q) <= TRUSTED_RMS_PX, sentences.views_apart),
        (not Apart(q.disagreement_pct, q.disagreement_deg).is_same, sentences.halves_apart),
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
    """Whether the start camera sits on the photo better than the refined one by `margin` (share of the corners; a quarter of
    its own where most of the photo is hidden), as far as there are enough corners to tell.
    """
    return start.corners >= MIN_CORNERS and start.agreement > refined.agreement + min(margin, start.agreement / 4)


def _coverage(views: Sequence[ViewMatches], pinhole: Intrinsics) -> float:
    """Share of the photo's CELLS x CELLS cells with at least one match in any view."""
    points = np.concatenate([v.query for v in views]) if views else np.zeros((0, 2))
    return filled_cells(pinhole.to_pixels(points), (pinhole.width, pinhole.height), CELLS) / CELLS**2
