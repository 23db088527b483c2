"""What a refinement reports: progress while it runs, a record per iteration, and the report at its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose

Verdict = Literal["trusted", "check", "failed"]
NAN = float("nan")


@dataclass(frozen=True)
class IterationRecord:
    """One finished iteration: usable views, matches and inliers over them, pose after it. rms_px_of_photo: RMS distance of the
    inliers from their epipolar lines, in pixels of the photo as it is, NaN where there was no fit.
    """

    index: int
    views_used: int
    matches: int
    inliers: int
    rms_px_of_photo: float
    pose: Pose


@dataclass(frozen=True)
class RefineProgress:
    """One step of the work. `fraction` 0..1 of the whole; `record` is set on the step that ends an iteration."""

    iteration: int
    iterations: int
    step: str
    fraction: float
    record: IterationRecord | None = None


LensState = Literal["given", "solved", "held", "shared"]
# The numbers of a lens that a report tells of, in this order.
LENS_NUMBERS = ("focal", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "squeeze")


@dataclass(frozen=True)
class LensNumber:
    """One number of a lens: "given" with a calibration, "solved" for, "held" near its guess, because the matches tell it hardly
    better than that, or "shared" with other photos. `std`: standard deviation of the value, infinite where nothing bounds it.
    "focal" (the geometric mean of fx and fy), "cx" and "cy" are pixels of the photo at its full size, "squeeze" is fx / fy.
    """

    name: str
    state: LensState
    value: float
    std: float


@dataclass(frozen=True, eq=False)
class LensEvidence:
    """What a photo's matches know, for `shared_lens.share_lens`: `information` (15, 15) by xi (scene units, radians) and the
    numbers of `lens.NAMES`, at the photo's own solution; `guess`: the lens that its prior was about, at the photo's full size;
    `focal_std`: the deviation of that prior's focal length, as a share of it.
    """

    information: FloatArray
    guess: Intrinsics
    focal_std: float = 0.3


EvidenceOf = Literal["refined", "start", "rejected"]


@dataclass(frozen=True)
class PoseQuality:
    """The evidence behind a verdict (docs/design.md, section 5), and the pose that it is of.

    of: "refined" = the pose that is returned was found; "start" = the start camera fits the photo better and is returned, so
    the evidence is of that; "rejected" = the verdict is "failed", the start camera is returned, and this is why the pose that
    was found is not returned. pose: that pose.

    Pixels are those of the photo as it is, `photo_long_side_px` along its longer side; per cent are of `median_depth` (scene
    units, over the view that was matched), of the focal length for focal_std_pct. A figure that there is not is NaN, one that
    has no bound infinite.

    views_used: rendered views whose matches hold a two-view pose; inliers: matches in the last fit, over all views; coverage:
    share (0..1) of the photo's 6 x 6 cells that hold an inlier; rms_px_of_photo: RMS of those inliers' distances from their
    epipolar lines; disagreement_pct, disagreement_deg: distance between the answers of two halves of the views (NaN with fewer
    than four views); translation_std_pct, rotation_std_deg, focal_std_pct: standard deviations, from the fit's covariance which
    knows what the splat's own errors (`joint.SHARED_ERROR`) and a lens that was not solved for may add; lens_log_odds: by how
    much another lens makes the matches likelier (`lens_doubt`, a natural logarithm), lens_shift_pct, lens_shift_deg: how far
    that lens would move the camera; lens_focal_pct: by how much its focal length is longer; corners: the photo's corners over
    the splat that were looked at; agreement: share of them (0..1) that sit on the final render; offset_px_of_photo: median
    distance of those that could be followed; similarity: correlation (-1..1) of photo and render, free of exposure. Of the part
    of the photo in which the render sits: region_corners: corners that stay in place there; region_share: (0..1) of all corners
    there; region_expected: how many would by chance; region_area: share (0..1) of the photo within their hull;
    region_offset_px_of_photo: their median displacement; unrivalled: share (0..1) of patches there that the render shows
    nowhere around better than in their place. A start that was kept took no part in a fit: only what follows lens_focal_pct
    here is known of it.
    """

    of: EvidenceOf
    pose: Pose
    photo_long_side_px: int
    median_depth: float
    corners: int
    agreement: float
    offset_px_of_photo: float
    similarity: float
    views_used: int = 0
    inliers: int = 0
    coverage: float = 0.0
    rms_px_of_photo: float = NAN
    disagreement_pct: float = NAN
    disagreement_deg: float = NAN
    translation_std_pct: float = NAN
    rotation_std_deg: float = NAN
    focal_std_pct: float = NAN
    lens_log_odds: float = NAN
    lens_shift_pct: float = 0.0
    lens_shift_deg: float = 0.0
    lens_focal_pct: float = NAN
    region_corners: int = 0
    region_share: float = 0.0
    region_expected: float = 0.0
    region_area: float = 0.0
    region_offset_px_of_photo: float = NAN
    unrivalled: float = NAN


@dataclass(frozen=True)
class RefineReport:
    """The end of a refinement. `camera` is the refined camera; when the verdict is "failed" it is the start, unchanged.

    `reasons` are whole sentences in plain words, the decisive one first, `details` the figures behind them for who knows the
    terms; `seconds` is wall time; `quality` is the evidence and says which pose it belongs to, None when no pose was found;
    `stage` names the fit that gave the pose ("joint", "epipolar", "depth", "loop", and "faces" for the mean of a panorama's
    parts); `lens` says of each number of the lens whether it was solved for and how sure it is, empty where no pose was found;
    `lens_evidence` is what the photo can tell other photos of that lens, None where not all of it was solved for, or it was
    given.
    """

    camera: Camera
    start: Camera
    verdict: Verdict
    reasons: tuple[str, ...]
    iterations: tuple[IterationRecord, ...]
    seconds: float
    quality: PoseQuality | None = None
    stage: str = ""
    lens: tuple[LensNumber, ...] = ()
    lens_evidence: LensEvidence | None = None
    details: tuple[str, ...] = ()

    @property
    def solved_lens(self) -> bool:
        """Whether anything of the lens was solved for."""
        return any(number.state in ("solved", "shared") for number in self.lens)
