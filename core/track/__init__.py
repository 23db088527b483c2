"""A moving plate tracked: every frame tied to the splat and to its neighbours, then one problem over the whole shot."""

from .check import iterate_check
from .report import FrameState, Track, TrackedFrame, TrackProgress
from .settings import TrackSettings
from .track import Shot, iterate_track, track_of
from .walk import PartialTrack

__all__ = [
    "FrameState",
    "PartialTrack",
    "Shot",
    "Track",
    "TrackProgress",
    "TrackSettings",
    "TrackedFrame",
    "iterate_check",
    "iterate_track",
    "track_of",
]
