"""Some frames of a track made anew, tied to those beside them, which stay as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..errors import RefineError
from ..geometry.camera import Camera
from ..render.view import ViewRenderer
from .report import Track
from .settings import TrackSettings
from .track import DOUBTED, Shot, Tracking, focal_range, iterate_track, judge_frames, zooms
from .walk import PartialTrack


@dataclass(frozen=True, eq=False)
class Earlier:
    """A track, with cameras of frames inside of the range that is made anew, where the tracking is to begin too."""

    track: Track
    starts: Mapping[int, Camera] = field(default_factory=dict)


def iterate_again(
    renderer: ViewRenderer, shot: Shot, earlier: Earlier, settings: TrackSettings, found: PartialTrack | None = None
) -> Tracking:
    """Tracks the frames of `shot` anew and returns the whole of the `earlier` track with them in their places; yields as
    `iterate_track` does.

    The frames on either side of the range are what it begins at and what it is tied to; they and all others are returned as
    they were, so are the lens of the shot and the read-out of its shutter, which hold for the range as well; of a track with a
    zoom, the focal length of these frames is solved anew. Raises RefineError where the range has neither neighbours that are
    tied to the splat nor a start.
    """
    before = earlier.track
    wanted, known = set(shot.frames), {frame.frame: frame for frame in before.frames}
    sides = [max((f for f in known if f < min(wanted)), default=None), min((f for f in known if f > max(wanted)), default=None)]
    ends = {f: known[f] for f in sides if f is not None and known[f].state != "lost"}
    if not ends and not earlier.starts:
        raise RefineError("No frame beside the range is tied to the splat; give a start inside of it, or a wider range.")
    cameras = {f: replace(frame.camera, focal_guessed=False) for f, frame in ends.items()}
    settings = replace(settings, rolling_shutter=False)
    starts = {f: replace(camera, focal_guessed=False) for f, camera in earlier.starts.items()}
    if not zooms(before.frames):
        settings = replace(settings, focal="fixed")
        starts = {f: replace(camera, intrinsics=before.lens) for f, camera in starts.items()}
    elif settings.focal_change is None:
        settings = replace(settings, focal="zoom")
    doubted = any(frame.reason == DOUBTED for frame in before.frames)
    whole = replace(
        shot,
        frames=sorted({*ends, *wanted}),
        pinned={**shot.pinned, **{f: camera.pose for f, camera in cameras.items()}},
        readout=before.readout,
        doubt=shot.doubt or (before.reasons[0] if doubted and before.reasons else ""),
    )
    new = yield from iterate_track(renderer, whole, {**starts, **cameras}, settings, found)
    return _joined(before, new, wanted)


def _joined(before: Track, new: Track, wanted: set[int]) -> Track:
    """`before` with the frames `wanted` as `new` has them, judged anew."""
    frames = {f.frame: f for f in before.frames} | {f.frame: f for f in new.frames if f.frame in wanted}
    whole = tuple(frames[number] for number in sorted(frames))
    verdict, reasons = judge_frames(whole)
    doubt = before.reasons[:1] if any(frame.reason == DOUBTED for frame in whole) else ()
    if doubt and verdict == "trusted":
        verdict = "check"
    reasons = (*reasons, focal_range(whole)) if zooms(whole) else reasons
    seconds = before.seconds + new.seconds
    return replace(before, frames=whole, verdict=verdict, reasons=(*doubt, *reasons), seconds=seconds)
