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
from ..source import MovingPhoto, moving_photo, shot_name
from ..words import by_sentence, frame_list
from . import errors as frame_errors
from .job import TrackJob

log = logging.getLogger(__name__)
OTHER = ("PHOTO", "SPLAT")  # What makes a track one of something else: another photo, another splat.
SHOWS = "shows"  # In a kept track: the name of the shot, and what is added to a frame of the scene for the plate's.


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
    camera.data.gssmc.track = json.dumps({**track_to_dict(track), SHOWS: _shows(job.plate)})
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
    """The camera's track, where it is of this plate and goes beyond the frames from `start` to `end`; None otherwise.

    Raises RefineError where these frames cannot be tied to it, for something moved since.
    """
    text, plate, change = camera.data.gssmc.track, moving_photo(camera), camera_solution.change(scene, camera)
    if not text or plate is None or change in OTHER:
        return None
    try:
        data = json.loads(text)
        track = track_from_dict(data, camera.name)
        name, offset = data.get(SHOWS, _shows(plate))  # Tracks of older versions do not have it.
    except (CameraError, TypeError, ValueError) as error:
        log.warning("The track kept on %s cannot be read: %s", camera.name, error)
        return None
    if name != _shows(plate)[0] or all(start <= frame.frame <= end for frame in track.frames):
        return None
    if offset != plate.offset:
        raise RefineError(
            rpt_(
                "Another frame of the plate shows at frame {frame} than when it was tracked; shift it back, or track all.",
                frame=scene.frame_current,
            )
        )
    if change == "LENS":
        raise RefineError(
            rpt_("The lens changed since the plate was tracked, and holds for all of it; use Back to Solution first.")
        )
    _check_beside(scene, camera, track, start, end)
    return track


def _shows(plate: MovingPhoto) -> list[object]:
    return [shot_name(plate.plate.path), plate.offset]


def _check_beside(scene: bpy.types.Scene, camera: bpy.types.Object, track: Track, start: int, end: int) -> None:
    """Raises RefineError where a frame that the range is tied to no longer has the camera that it is tied to."""
    before = [frame for frame in track.frames if frame.frame < start][-1:]
    beside = [*before, *[frame for frame in track.frames if frame.frame > end][:1]]
    path = {frame.frame: frame.camera for frame in beside if frame.state != "lost"}
    if not path:
        return
    depth, points = track.median_depth, len(scene.gssmc.splat.data.points)
    then = SolvedCamera(next(iter(path.values())), "", (), 0, 0.0, "", depth, points, path=path)
    moved = camera_solution.moved_at(scene, camera, then, path)
    if moved:
        raise RefineError(
            rpt_(
                "At frame {frame}, beside the range, the camera moved since it was tracked; pin it and take it into the range, "
                "or use Back to Solution.",
                frame=moved[0],
            )
        )


def _keys(job: TrackJob, frames: list[TrackedFrame]) -> camera_keys.KeyOptions:
    zooms = any(frame.camera.intrinsics != frames[0].camera.intrinsics for frame in frames)
    filled = frozenset(frame.frame for frame in frames if frame.state == "lost")
    return camera_keys.KeyOptions(zooms, filled, frozenset(job.options.pinned))


def keyed(track: Track) -> list[TrackedFrame]:
    """The frames that get a key: lost ones before the first and behind the last that is tied to the splat get none."""
    tied = [i for i, frame in enumerate(track.frames) if frame.state != "lost"]
    return list(track.frames[tied[0] : tied[-1] + 1]) if tied else []
