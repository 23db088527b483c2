"""What a tracked plate leaves in Blender: keys from the first frame tied to the splat to the last, a verdict, a sentence."""

from __future__ import annotations

from ...core.errors import RefineError
from ...core.geometry.camera import Camera
from ...core.track import Track, TrackedFrame
from ..camera import keys as camera_keys
from ..camera import solution as camera_solution
from ..camera.record import SolvedCamera
from ..support.texts import rpt_
from . import errors as frame_errors
from .track_job import TrackJob
from .words import by_sentence, frame_list


def write(job: TrackJob, track: Track) -> tuple[str, bool]:
    """Keys the cameras of `track` and keeps its verdict on the camera. What is to be said, and whether all of it is trusted.

    Raises GssmcError, with nothing written, when the track failed or something was removed.
    """
    scene, splat, camera = job.targets.find()
    if track.verdict == "failed":
        raise RefineError(rpt_("{reason} Nothing was changed.", reason=track.reasons[0]))
    frames = keyed(track)
    cameras: dict[int, Camera] = {frame.frame: frame.camera for frame in frames}
    filled = frozenset(frame.frame for frame in frames if frame.state == "lost")
    camera_keys.write(scene, camera, splat, cameras, camera_keys.KeyOptions(filled=filled))
    state = "SOLVED" if track.numbers else camera.data.gssmc.lens_state
    lines = tuple([*track.reasons, *by_sentence({frame.frame: frame.reason for frame in track.frames if frame.reason})])
    first = cameras[min(cameras)]
    solved = SolvedCamera(first, track.verdict, lines, 0, track.seconds, state, track.median_depth, path=cameras)
    camera_solution.keep(scene, camera, splat, solved)
    frame_errors.write(camera.data, track.frames)
    weak = [frame.frame for frame in track.frames if frame.state != "good"]
    camera.data.gssmc.frames_done, camera.data.gssmc.bad_frames = len(track.frames), frame_list(weak)
    camera.data.gssmc.weak_frames = " ".join(map(str, weak))
    values = {"name": camera.name, "summary": track.reasons[0], "count": len(cameras)}
    message = rpt_('"{name}": {summary} {count} keys were set.', **values)
    if len(cameras) == 1:
        message = rpt_('"{name}": {summary} 1 key was set.', **values)
    return message, track.verdict == "trusted"


def keyed(track: Track) -> list[TrackedFrame]:
    """The frames that get a key: lost ones before the first and behind the last that is tied to the splat get none."""
    tied = [i for i, frame in enumerate(track.frames) if frame.state != "lost"]
    return list(track.frames[tied[0] : tied[-1] + 1]) if tied else []
