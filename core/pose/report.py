"""What a refinement tells: progress while it runs, a record per iteration, and the report at its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..geometry.camera import Camera, Pose

Verdict = Literal["trusted", "check", "failed"]


@dataclass(frozen=True)
class IterationRecord:
    """One finished iteration: usable views, matches and inliers over them, epipolar RMS (photo pixels), pose after it."""

    index: int
    views_used: int
    matches: int
    inliers: int
    epipolar_rms_px: float
    pose: Pose


@dataclass(frozen=True)
class RefineProgress:
    """One step of the work. `fraction` 0..1 of the whole; `record` is set on the step that ends an iteration."""

    iteration: int
    iterations: int
    step: str
    fraction: float
    record: IterationRecord | None = None


@dataclass(frozen=True)
class PoseQuality:
    """The evidence behind a verdict (docs/design.md, section 5).

    views_used: rendered views whose matches hold a two-view pose; inliers: matches in the last fit, over all views;
    coverage: share (0..1) of the photo's 6 x 6 cells that hold an inlier; epipolar_rms_px: RMS of those inliers;
    disagreement: distance between the answers of two halves of the views, in per cent of the median depth, and
    disagreement_deg in degrees (NaN with fewer than four views); translation_std (per cent of the median depth) and
    rotation_std_deg: deviations from the fit's covariance; focal_std: the same of the focal length, per cent (NaN when it was
    not solved for); lens_gain: by how many per cent epipolar_rms_px falls where focal length, k1 and k2 are free as well
    (0 when they were); agreement, offset_px, similarity: see `verify.FinalView`.
    """

    views_used: int
    inliers: int
    coverage: float
    epipolar_rms_px: float
    disagreement: float
    disagreement_deg: float
    translation_std: float
    rotation_std_deg: float
    focal_std: float
    agreement: float
    offset_px: float
    similarity: float
    median_depth: float
    lens_gain: float = 0.0


@dataclass(frozen=True)
class RefineReport:
    """The end of a refinement. `camera` is the refined camera; when the verdict is "failed" it is the start, unchanged.

    `reasons` are whole sentences; `seconds` is wall time; `quality` is the evidence, None when no pose was found at all;
    `stage` names the fit that gave the pose ("joint", "epipolar", "depth", "loop"), `lens` what of the lens was solved for.
    """

    camera: Camera
    start: Camera
    verdict: Verdict
    reasons: tuple[str, ...]
    iterations: tuple[IterationRecord, ...]
    seconds: float
    quality: PoseQuality | None = None
    stage: str = ""
    lens: str = "fixed"
