"""A track as JSON: a camera file like any other, with what is known of each frame beside its camera."""

from __future__ import annotations

import math
from typing import Any

from ..cameras.files import camera_to_dict
from ..pose.report import Verdict
from ..pose.report_json import lens_to_dict
from .report import FrameState, Track

# What other commands read of a frame: those that take only trusted cameras take the good ones.
VERDICT_OF: dict[FrameState, Verdict] = {"good": "trusted", "weak": "check", "lost": "failed"}


def track_to_dict(track: Track) -> dict[str, Any]:
    """All frames in the camera format under "frames", each with "frame", "verdict", "reasons", "matches" and "rms_px"; of the
    shot "verdict", "reasons", "lens", "readout", "median_depth" and "seconds".
    """
    frames = [
        {
            **camera_to_dict(frame.camera),
            "frame": frame.frame,
            "verdict": VERDICT_OF[frame.state],
            "reasons": [frame.reason] if frame.reason else [],
            "matches": frame.matches,
            "rms_px": None if math.isnan(frame.rms_px) else round(frame.rms_px, 3),
        }
        for frame in track.frames
    ]
    return {
        "verdict": track.verdict,
        "reasons": list(track.reasons),
        "lens": lens_to_dict(track.numbers),
        "readout": round(track.readout, 4),
        "median_depth": track.median_depth,
        "seconds": round(track.seconds, 1),
        "frames": frames,
    }
