"""What a refinement tells: progress while it runs, a record per iteration, and the report at its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..camera import Camera, Pose

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
class RefineReport:
    """The end of a refinement. `camera` is the refined camera; when the verdict is "failed" it is the start, unchanged.

    `reasons` are whole sentences; `seconds` is wall time.
    """

    camera: Camera
    start: Camera
    verdict: Verdict
    reasons: tuple[str, ...]
    iterations: tuple[IterationRecord, ...]
    seconds: float
