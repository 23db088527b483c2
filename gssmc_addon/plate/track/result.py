"""What a tracked plate leaves in Blender: keys from the first frame tied to the splat to the last, a verdict, a sentence."""

from __future__ import annotations

import json
import logging

import bpy

from ....core.errors import CameraError, RefineError
from ....core.geometry.camera import Camera
from ....core.track import Track, TrackedFrame
from ....core.track.file import track_from_dict, track_to_dict
from ...camera import keys as camera_keys
from ...camera import solution as camera_solution
from ...camera.record import SolvedCamera
from ...support.texts import rpt_
from ..words import by_sentence, frame_list
from . import errors as frame_errors
from .job import TrackJob

log = logging.getLogger(__name__)
HOLDS = ("", "FRAME", "MOVED")  # What may have changed since: which frame is shown, and where the camera stands at it.


def write(job: TrackJob, track: Track) -> tuple[str, bool]:
    """Keys the cameras of `track` and keeps its verdict on the camera. What is to be said, and whether all of it is trusted.

    Raises GssmcError, with nothing written, when the track failed or something was removed.
    """
    scene, splat, camera = job.targets.find()
    if track.verdict == "failed":
        raise RefineError(rpt_("{reason} Nothing was changed.", reason=track.reasons[0]))
    frames = keyed(track)
    cameras: dict[int, Camera] = {frame.frame: frame.camera for frame in frames}
    new = {f: c for f, c in cameras.items() if job.options.start <= f <= job.options.end}
    camera_keys.write(scene, camera, splat, new, _keys(job, frames))
    state = "SOLVED" if track.numbers else camera.data.gssmc.lens_state
    lines = tuple([*track.reasons, *by_sentence({frame.frame: frame.reason for frame in track.frames if frame.reason})])
    first = cameras[min(cameras)]
    solved = SolvedCamera(first, track.verdict, lines, 0, track.seconds, state, track.median_depth, path=cameras)
    camera_solution.keep(scene, camera, splat, solved)
    camera.data.gssmc.track = json.dumps(track_to_dict(track))
    frame_errors.write(camera.data, track.frames)
    weak = [frame.frame for frame in track.frames if frame.state != "good"]
    camera.data.gssmc.frames_done, camera.data.gssmc.bad_frames = len(track.frames), frame_list(weak)
    camera.data.gssmc.weak_frames = " ".join(map(str, weak))
    values = {"name": camera.name, "summary": track.reasons[0], "count": len(new)}
    message = rpt_('"{name}": {summary} {count} keys were set.', **values)
    if len(new) == 1:
        message = rpt_('"{name}": {summary} 1 key was set.', **values)
    return message, track.verdict == "trusted"


def earlier(scene: bpy.types.Scene, camera: bpy.types.Object, start: int, end: int) -> Track | None:
    """The camera's track, where it still holds and goes beyond the frames from `start` to `end`; None otherwise."""
    text = camera.data.gssmc.track
    if not text or camera_solution.change(scene, camera) not in HOLDS:
        return None
    try:
        track = track_from_dict(json.loads(text), camera.name)
    except (CameraError, ValueError) as error:
        log.warning("The track kept on %s cannot be read: %s", camera.name, error)
        return None
    return track if any(not start <= frame.frame <= end for frame in track.frames) else None


def _keys(job: TrackJob, frames: list[TrackedFrame]) -> camera_keys.KeyOptions:
    zooms = any(frame.camera.intrinsics != frames[0].camera.intrinsics for frame in frames)
    filled = frozenset(frame.frame for frame in frames if frame.state == "lost")
    return camera_keys.KeyOptions(zooms, filled, frozenset(job.options.pinned))


def keyed(track: Track) -> list[TrackedFrame]:
    """The frames that get a key: lost ones before the first and behind the last that is tied to the splat get none."""
    tied = [i for i, frame in enumerate(track.frames) if frame.state != "lost"]
    return list(track.frames[tied[0] : tied[-1] + 1]) if tied else []
