"""A moving plate tracked: every frame tied to the splat and to its neighbours, then one problem over the whole shot."""

from .report import FrameState, Track, TrackedFrame, TrackProgress
from .settings import TrackSettings
from .track import Shot, iterate_track
from .walk import Found

__all__ = ["Found", "FrameState", "Shot", "Track", "TrackProgress", "TrackSettings", "TrackedFrame", "iterate_track"]
