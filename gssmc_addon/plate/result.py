"""What a refined plate leaves in Blender: keys, verdict and a sentence."""

from __future__ import annotations

from ..camera import keys as camera_keys
from ..camera import solution as camera_solution
from ..camera.record import SolvedCamera
from ..support.texts import rpt_
from .job import SequenceJob
from .words import frame_list


def write(job: SequenceJob) -> tuple[str, bool]:
    """Keys the cameras of `job` and keeps its verdict on the camera. What is to be said, and whether all of it is trusted.

    Raises GssmcError, with nothing written, when no frame is good or something was removed.
    """
    scene, splat, camera = job.targets.find()
    cameras = job.path()
    filled = frozenset(cameras) - {frame for frame in job.reports if frame not in job.bad}
    camera_keys.write(scene, camera, splat, cameras, camera_keys.KeyOptions(job.options.key_lens, filled))
    seconds = sum(report.seconds for report in job.reports.values())
    trusted = not (job.bad or job.doubtful or job.unheld or job.lens_doubt)
    solved = job.lens_solved or (job.options.key_lens and job.settings.lens != "fixed")
    state = "SOLVED" if solved else camera.data.gssmc.lens_state
    first, verdict = cameras[min(cameras)], "trusted" if trusted else "check"
    solved_camera = SolvedCamera(first, verdict, tuple(job.reasons()), 0, seconds, state, job.median_depth, path=cameras)
    camera_solution.keep(scene, camera, splat, solved_camera)
    camera.data.gssmc.track = ""  # The keys are no longer those of an earlier track.
    camera.data.gssmc.frames_done, camera.data.gssmc.bad_frames = job.items, frame_list({*job.bad, *job.unheld})
    camera.data.gssmc.weak_frames = " ".join(map(str, sorted({*job.bad, *job.doubtful, *job.unheld})))
    values = {"name": camera.name, "summary": job.summary(), "count": len(cameras)}
    message = rpt_('"{name}": {summary} {count} keys were set.', **values)
    if len(cameras) == 1:
        message = rpt_('"{name}": {summary} 1 key was set.', **values)
    return message, trusted
