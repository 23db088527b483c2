"""A moving plate tracked: every frame tied to the splat and to its neighbours, then one problem over the whole shot."""

from .again import Earlier, iterate_again
from .check import iterate_check
from .focal import FocalKind
from .report import FrameState, Track, TrackedFrame, TrackProgress
from .settings import TrackSettings
from .track import Shot, Tracking, iterate_track, track_of
from .walk import PartialTrack

__all__ = [
    "Earlier",
    "FocalKind",
    "FrameState",
    "PartialTrack",
    "Shot",
    "Track",
    "TrackProgress",
    "TrackSettings",
    "TrackedFrame",
    "Tracking",
    "iterate_again",
    "iterate_check",
    "iterate_track",
    "track_of",
]
