"""What a track reports: progress while it runs, and every frame's camera with how well it sits at the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..geometry.camera import Camera, Intrinsics
from ..pose.report import LensNumber, Verdict

FrameState = Literal["good", "weak", "lost"]


@dataclass(frozen=True)
class TrackedFrame:
    """A frame's camera, for the photo at its full size.

    state: "good" = many matches hold the camera and it sits on the splat; "weak" = the camera is tied to the splat, by less
    than that; "lost" = nothing ties it to the splat, and the camera lies on the path of the frames beside it. reason: why it is
    not good, one sentence. matches: corners that sit on the splat. rms_px: RMS distance of these from their places, in pixels
    of the frame as it is, NaN where it is lost. focal_std_pct: deviation of its focal length, per cent, NaN where the lens does
    not zoom.
    """

    frame: int
    camera: Camera
    state: FrameState
    reason: str
    matches: int
    rms_px: float
    focal_std_pct: float = float("nan")


@dataclass(frozen=True)
class TrackProgress:
    """One step of the work. `fraction`: 0..1 of the whole; `found`: the camera of the frame that was just solved."""

    fraction: float
    step: str
    frame: int
    found: Camera | None = None


@dataclass(frozen=True)
class Track:
    """The end of a track, in the order of the frames.

    `lens`: the shot's, at the frames' full size, and `numbers` what was solved of it; `readout`: the time that reading a frame
    out takes, as a share of the time from frame to frame, 0 where it was not solved for. `reasons`: whole sentences.
    """

    frames: tuple[TrackedFrame, ...]
    lens: Intrinsics
    numbers: tuple[LensNumber, ...]
    readout: float
    median_depth: float
    verdict: Verdict
    reasons: tuple[str, ...]
    seconds: float
