"""A track as JSON: a camera file like any other, with what is known of each frame beside its camera."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

from ..cameras.files import camera_from_dict, camera_to_dict, load_json
from ..errors import CameraError
from ..geometry.conventions import focal_px_from_35mm
from ..pose.report import Verdict
from ..pose.report_json import lens_from_dict, lens_to_dict
from .report import FrameState, Track, TrackedFrame

# What other commands read of a frame: those that take only trusted cameras take the good ones.
VERDICT_OF: dict[FrameState, Verdict] = {"good": "trusted", "weak": "check", "lost": "failed"}
STATE_OF: dict[str, FrameState] = {verdict: state for state, verdict in VERDICT_OF.items()}


def track_to_dict(track: Track) -> dict[str, Any]:
    """All frames in the camera format under "frames", each with "frame", "verdict", "reasons", "matches", "rms_px" and, where
    the lens zooms, "focal_35mm" (mm) with "focal_std_pct"; of the shot "verdict", "reasons", "lens", "readout", "median_depth"
    and "seconds".
    """
    frames = [
        {
            **camera_to_dict(frame.camera),
            "frame": frame.frame,
            "verdict": VERDICT_OF[frame.state],
            "reasons": [frame.reason] if frame.reason else [],
            "matches": frame.matches,
            "rms_px": None if math.isnan(frame.rms_px) else round(frame.rms_px, 3),
            **_focal(frame),
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


def read_track(path: Path) -> Track:
    """The track that `track_to_dict` made the file of, in the coordinates that it was written in. The lens of the shot is that
    of its first frame. Raises CameraError where the file is another one.
    """
    return track_from_dict(load_json(path), path.name)


def track_from_dict(data: Any, name: str) -> Track:
    """The track that `track_to_dict` made the dictionary of. Raises CameraError, with `name`, where it is another one."""
    records = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(records, list) or not records:
        raise CameraError(f"'{name}' is no track; give the file that track wrote.")
    try:
        frames = tuple(sorted(map(_frame, records), key=lambda frame: frame.frame))
        numbers = lens_from_dict(data["lens"]) if data["lens"] else ()
        told = {name: float(data[name]) for name in ("readout", "median_depth", "seconds")}
        if not all(map(math.isfinite, told.values())):
            raise ValueError("a number that is none")
        twice = [a.frame for a, b in pairwise(frames) if a.frame == b.frame]
        if twice:
            raise ValueError(f"frame {twice[0]} stands there twice")
        lens, verdict, reasons = frames[0].camera.intrinsics, data["verdict"], tuple(map(str, data["reasons"]))
        if verdict not in STATE_OF:
            raise ValueError(verdict)
        return Track(frames, lens, numbers, verdict=verdict, reasons=reasons, **told)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise CameraError(f"'{name}' is no track, or a damaged one ({error}); give the file that track wrote.") from None


def _focal(frame: TrackedFrame) -> dict[str, float]:
    if math.isnan(frame.focal_std_pct):
        return {}
    k = frame.camera.intrinsics
    focal_mm = k.focal / focal_px_from_35mm(1.0, k.width, k.height)
    return {"focal_35mm": round(focal_mm, 4), "focal_std_pct": round(frame.focal_std_pct, 4)}


def frame_numbers(path: Path) -> list[int]:
    """The numbers of a track's frames in the order of its file; empty where the file is none."""
    try:
        return [int(record["frame"]) for record in load_json(path)["frames"]]
    except (CameraError, LookupError, TypeError, ValueError):
        return []


def _frame(record: Any) -> TrackedFrame:
    camera = camera_from_dict(record, f"Frame {record['frame']}")
    rms = float("nan") if record["rms_px"] is None else float(record["rms_px"])
    reason = " ".join(map(str, record["reasons"]))
    std = float(record.get("focal_std_pct", "nan"))
    return TrackedFrame(int(record["frame"]), camera, STATE_OF[record["verdict"]], reason, int(record["matches"]), rms, std)
