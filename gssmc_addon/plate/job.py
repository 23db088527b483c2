"""A moving plate refined: every Nth frame in a queue, each from its neighbour's answer, and the keys that come of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import median

import bpy

from ...core.errors import PhotoError, RefineError
from ...core.geometry.camera import Camera
from ...core.pose import sequence
from ...core.pose.report import RefineProgress, RefineReport
from ...core.pose.sequence import FramePose
from ...core.pose.settings import RefineSettings
from ..camera import bridge as camera_bridge
from ..jobs.machine import QueueJob
from ..jobs.worker import RefineInputs, Steps, refinement
from ..photo import mask as mask_source
from ..refine import job as jobs
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.texts import iface_, n_, rpt_
from . import source as plate_source

DOUBT = 0.25  # weight of a frame whose verdict is "check"
SHOWN_FRAMES = 12


@dataclass(frozen=True)
class SequenceOptions:
    """Frames of the scene from `start` to `end` by `step`; `smooth_frames`: shorter wiggles are taken out."""

    start: int
    end: int
    step: int
    smooth_frames: float
    every_frame: bool
    key_lens: bool


class SequenceJob(QueueJob):
    """Refines the frames outward from the current one. Its result is the job itself; `path()` makes the keys of it."""

    status = n_("Refining the plate    Esc: cancel")

    def __init__(
        self, scene: bpy.types.Scene, camera: bpy.types.Object, options: SequenceOptions, settings: RefineSettings
    ) -> None:
        self._plate = plate_source.moving_photo(camera)
        if self._plate is None:
            raise PhotoError(plate_source.no_plate(camera))
        splat = scene.gssmc.splat
        frames = sequence.keyframes(options.start, options.end, options.step)
        copying = SplatCopying(splat)
        super().__init__(len(frames), copying)
        self.options, self.settings, self.camera_name = options, settings, camera.name
        self.order = sequence.outward(frames, scene.frame_current)
        self.reports: dict[int, RefineReport] = {}
        self.bad: dict[int, str] = {}
        self._uids = scene.session_uid, splat.session_uid, camera.session_uid
        self._mask = mask_source.of(camera)
        self._copy = camera_bridge.read_camera(scene, camera, splat)
        self._renderer = SplatRenderer(copying, settings.threads)

    def find(self) -> tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]:
        """The live scene, splat and camera. Raises RefineError when something is gone."""
        scene = jobs.by_uid(bpy.data.scenes, self._uids[0])
        splat, camera = (jobs.by_uid(scene.objects, uid) if scene else None for uid in self._uids[1:])
        if splat is None or camera is None:
            raise RefineError(rpt_("The splat or the camera was removed while the plate was refined; nothing was changed."))
        return scene, splat, camera

    def check(self) -> None:
        self.find()

    def close(self) -> None:
        self._renderer.close()

    def begin_item(self, index: int) -> Callable[[], Steps]:
        frame = self.order[index]
        self.step = iface_("Frame {frame}", frame=frame)
        self.detail = iface_("{number} of {count} frames", number=index + 1, count=self.count)
        near = sequence.nearest(frame, self.reports)
        start = self._copy if near is None else replace(self._copy, pose=self.reports[near].camera.pose)
        source = mask_source.masked(self._plate.at(frame), self._mask)
        return partial(refinement, RefineInputs(self._renderer, source, start, self.settings))

    def note(self, news: RefineProgress) -> None:
        self.fraction = (self.index + news.fraction) / self.count

    def end_item(self, index: int, report: RefineReport) -> None:
        frame = self.order[index]
        if report.verdict == "failed":
            self.bad[frame] = report.reasons[0] if report.reasons else rpt_("No camera was found.")
        else:
            self.reports[frame] = report

    def fail_item(self, index: int, message: str) -> None:
        self.bad[self.order[index]] = message

    def result(self) -> SequenceJob:
        return self

    def path(self) -> dict[int, Camera]:
        """The cameras to key, by frame; strays join the bad frames. Raises RefineError when no frame is good."""
        track = [FramePose(f, r.camera.pose, 1.0 if r.verdict == "trusted" else DOUBT) for f, r in sorted(self.reports.items())]
        depths = [r.quality.median_depth for r in self.reports.values() if r.quality]
        for frame in sequence.stray_frames(track, median(depths)) if depths else ():
            self.bad[frame] = rpt_("Its camera lies off the path of the other frames.")
        track = [point for point in track if point.frame not in self.bad]
        if not track:
            first = next(iter(self.bad.values()), "")
            raise RefineError(rpt_("No frame of the plate could be refined; nothing was changed. {reason}", reason=first))
        poses = sequence.smooth(track, self.options.smooth_frames)
        frames = [point.frame for point in track]
        lenses = [self.reports[frame].camera for frame in frames]
        if self.options.every_frame and len(track) > 1:
            smoothed = [FramePose(frame, pose) for frame, pose in zip(frames, poses, strict=True)]
            filled = list(range(frames[0], frames[-1] + 1))
            lenses = [self.reports[sequence.nearest(frame, frames)].camera for frame in filled]
            frames, poses = filled, sequence.interpolate(smoothed, filled)
        return {frame: replace(lens, pose=pose) for frame, lens, pose in zip(frames, lenses, poses, strict=True)}

    @property
    def median_depth(self) -> float:
        """Over all frames, in units of the splat's file; 0 where none tells it."""
        depths = [report.quality.median_depth for report in self.reports.values() if report.quality]
        return median(depths) if depths else 0.0

    def summary(self) -> str:
        """One or two sentences on all frames."""
        good = self.count - len(self.bad)
        words = [rpt_("{good} of {count} frames of the plate were refined.", good=good, count=self.count)]
        if self.bad:
            words.append(rpt_("Bad and not keyed: {frames}.", frames=frame_list(self.bad)))
        return " ".join(words)


def frame_list(frames: dict[int, str]) -> str:
    """The frames in words, the first dozen of them."""
    numbers = sorted(frames)
    shown = ", ".join(map(str, numbers[:SHOWN_FRAMES]))
    more = len(numbers) - SHOWN_FRAMES
    return rpt_("{frames} and {count} more", frames=shown, count=more) if more > 0 else shown
