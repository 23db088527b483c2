"""What can be chosen about a track."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..errors import RefineError
from .focal import CHANGES, FocalChange, FocalKind


@dataclass(frozen=True)
class TrackSettings:
    """Raises RefineError for values that make no sense. Lengths in time are frames of the plate."""

    long_side_px: int = field(default=640, metadata={"help": "frames are matched at this length of their longer side, pixels"})
    solve_lens: bool = field(default=True, metadata={"help": "solve one lens for the shot, where it was not calibrated"})
    rolling_shutter: bool = field(default=False, metadata={"help": "solve for the time that reading a frame out takes"})
    smooth_frames: float = field(default=0.0, metadata={"help": "take out wiggles of the camera shorter than this many frames"})
    focal: FocalKind = field(default="fixed", metadata={"help": "whether the lens zooms, or breathes with its focus"})

    def __post_init__(self) -> None:
        if self.long_side_px < 160:
            raise RefineError(f"The frames would be matched at {self.long_side_px} pixels; give at least 160.")
        if not 0 <= self.smooth_frames <= 10_000:
            raise RefineError(f"The smoothing is {self.smooth_frames:g} frames; give 0 (none) or more, up to 10000.")
        if self.focal not in CHANGES:
            raise RefineError(f"The focal length is said to be '{self.focal}'; give one of {', '.join(CHANGES)}.")

    @property
    def focal_change(self) -> FocalChange | None:
        """How the focal length may change over the shot; None where it is one."""
        return CHANGES[self.focal]
