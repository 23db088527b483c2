"""A moving plate refined: every Nth frame in a queue, each from its neighbour's answer, and the keys that come of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from statistics import median

import bpy

from ...core.errors import RefineError
from ...core.geometry.camera import Camera, Intrinsics
from ...core.pose import sequence
from ...core.pose.report import RefineProgress, RefineReport
from ...core.pose.sequence import FramePose
from ...core.pose.settings import RefineSettings
from ...core.track import TrackProgress, iterate_check
from ...core.track.track import FAILED_SHARE
from ..camera import bridge as camera_bridge
from ..find import job as find_job
from ..jobs.retries import RetryQueue
from ..jobs.worker import Failure, Finished, RefineInputs, Steps, WorkThread, refinement
from ..photo import mask as mask_source
from ..photo.source import PhotoSource
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.texts import iface_, n_, rpt_
from . import source as plate_source
from .options import SequenceOptions
from .reader import PlateReader
from .targets import PlateTargets
from .words import by_sentence, first_reason, frame_list

DOUBT = 0.25  # The weight of a frame whose verdict is "check".


class SequenceJob(RetryQueue):
    """Refines the frames outward from the current one; those of which no camera was found again from solved ones beside them.

    Its result is the job itself; `path()` makes the keys of it.
    """

    status = n_("Refining the plate    Esc: cancel")

    def __init__(
        self, scene: bpy.types.Scene, camera: bpy.types.Object, options: SequenceOptions, settings: RefineSettings
    ) -> None:
        plate = self._plate = plate_source.plate_of(camera)
        splat = scene.gssmc.splat
        frames = sequence.keyframes(options.start, options.end, options.step)
        copying = SplatCopying(splat)
        super().__init__(len(frames), copying)
        self.options, self.settings, self.camera_name = options, settings, camera.name
        self.lens: Intrinsics | None = None  # The lens of the whole plate, once a frame has solved it.
        self.lens_solved = False  # Whether the last stage made it exact too.
        self.lens_doubt = ""  # Why the frame that solved it is not trusted.
        self.unheld: dict[int, str] = {}  # Why keyed frames do not sit on the splat, as the last look at them says.
        self._cameras: dict[int, Camera] = {}
        self._look: WorkThread | None = None
        self.order = sequence.outward(frames, scene.frame_current)
        self.reports: dict[int, RefineReport] = {}
        self.bad: dict[int, str] = {}
        self._started: dict[int, int | None] = {}  # The frame whose camera was the start of a frame's first try.
        self._sought = False  # Whether a frame was looked for in the whole scan.
        self.targets = PlateTargets.of(scene, splat, camera)
        self._mask = mask_source.of(camera)
        self._reader = PlateReader(plate, self._mask)
        self._copy = camera_bridge.read_camera(scene, camera, splat)
        self._renderer = SplatRenderer(copying, settings.threads, keeps=options.find_start)
        self._finder = find_job.finder_of(scene, splat, self._renderer)

    def check(self) -> None:
        self.targets.find()

    def close(self) -> None:
        self._renderer.close()

    def begin_try(self, item: int, start: int | None) -> Callable[[], Steps]:
        """`start`: the frame whose camera is the start; in the first pass that of the nearest solved frame."""
        frame, (number, count) = self.order[item], self.place
        self.step = iface_("Frame {frame}", frame=frame)
        self.detail = iface_("{number} of {count}", number=number, count=count)
        if start is not None:
            self.detail = iface_("Again, {number} of {count}: from frame {frame}", number=number, count=count, frame=start)
        near = sequence.nearest(frame, self.reports) if start is None else start
        self._started.setdefault(frame, near)
        camera = self._copy if near is None else replace(self._copy, pose=self.reports[near].camera.pose)
        inputs = RefineInputs(self._renderer, self._source(frame), replace(camera, solved=self.lens), self._lens_settings())
        if near is None and self.options.find_start and not self._sought:
            self._sought = True  # It takes long, and where one frame cannot be found, no other of the shot can.
            return partial(self._finder.found_if_failed, inputs)
        return partial(refinement, inputs)

    def _source(self, frame: int) -> PhotoSource:
        return mask_source.masked(self._plate.frame_at(frame), self._mask)

    def _lens_settings(self) -> RefineSettings:
        """A plate has one lens: where it was guessed, the first frame solves for it, and the others are held to that."""
        if self.options.key_lens or (self.lens is None and self._copy.focal_guessed):
            return self.settings
        return replace(self.settings, lens="fixed")

    def on_progress(self, news: RefineProgress | TrackProgress) -> None:
        if isinstance(news, TrackProgress):
            self.fraction, self.step = news.fraction, iface_("Looking at every frame")
            self.detail = iface_("Frame {frame}", frame=news.frame)
        else:
            self.fraction = self.progress(news.fraction)

    def end_try(self, item: int, start: int | None, report: RefineReport) -> bool:
        frame = self.order[item]
        if report.verdict != "failed":
            self.reports[frame] = report
            self.bad.pop(frame, None)
            if self.lens is None and report.camera.intrinsics != report.start.intrinsics and not self.options.key_lens:
                self.lens, self.lens_solved = report.camera.intrinsics, report.solved_lens
                self.lens_doubt = "" if report.verdict == "trusted" else first_reason(report)
        elif start is None:
            self.bad[frame] = first_reason(report)
        return report.verdict != "failed"

    def fail_try(self, item: int, start: int | None, message: str) -> None:
        self.bad.setdefault(self.order[item], message)

    def other_starts(self, item: int) -> list[int]:
        """The nearest solved frames before and after, but for the one that was the start already."""
        frame = self.order[item]
        sides = [f for f in self.reports if f < frame], [f for f in self.reports if f > frame]
        near = [sequence.nearest(frame, side) for side in sides]
        return [f for f in near if f is not None and f != self._started[frame]]

    def result(self) -> SequenceJob | None:
        """The job itself, once every frame that gets a key was looked at where its key puts the camera."""
        if self._look is None:
            self._cameras = self._path()
            self._look = WorkThread(self._looking)
            self._look.start()
        self._reader.serve()
        for news in self._look.news():
            if isinstance(news, Failure):
                raise RefineError(news.message)
            if isinstance(news, Finished):
                self.unheld = news.result
                return self
            self.on_progress(news)
            self.show()
        return None

    def cancel(self) -> None:
        super().cancel()
        self._reader.stop()
        if self._look:
            self._look.stop()

    def join(self, timeout_s: float) -> bool:
        return self._look.join(timeout_s) if self._look else super().join(timeout_s)

    def path(self) -> dict[int, Camera]:
        """The cameras to key, by frame."""
        return self._cameras

    def _looking(self) -> Steps:
        return iterate_check(self._renderer.get(), self._reader.read, self._cameras, self.settings.long_side_px)

    def _path(self) -> dict[int, Camera]:
        """The cameras to key; strays join the bad frames. Raises RefineError when fewer than half of the frames are good."""
        track = [FramePose(f, r.camera.pose, 1.0 if r.verdict == "trusted" else DOUBT) for f, r in sorted(self.reports.items())]
        depths = [r.quality.median_depth for r in self.reports.values() if r.quality]
        for frame in sequence.stray_frames(track, median(depths)) if depths else ():
            self.bad[frame] = rpt_("Its camera lies off the path of the other frames.")
        track = [point for point in track if point.frame not in self.bad]
        self._check_enough(len(track))
        poses = sequence.smooth(track, self.options.smooth_frames)
        frames = [point.frame for point in track]
        lenses = [self.reports[frame].camera for frame in frames]
        if self.options.every_frame and len(track) > 1:
            smoothed = [FramePose(frame, pose) for frame, pose in zip(frames, poses, strict=True)]
            filled = list(range(frames[0], frames[-1] + 1))
            nearest = [sequence.nearest(frame, frames) for frame in filled]
            # It is never None, because `frames` holds at least two.
            lenses = [self.reports[near].camera for near in nearest if near is not None]
            frames, poses = filled, sequence.interpolate(smoothed, filled)
        lenses = [lens if self.lens is None else replace(lens, intrinsics=self.lens) for lens in lenses]
        return {frame: replace(lens, pose=pose) for frame, lens, pose in zip(frames, lenses, poses, strict=True)}

    def _check_enough(self, good: int) -> None:
        if good >= FAILED_SHARE * self.items and good:
            return
        first = next(iter(self.bad.values()), "")
        if not good:
            raise RefineError(rpt_("No frame of the plate could be refined; nothing was changed. {reason}", reason=first))
        values = {"good": good, "count": self.items, "reason": first}
        raise RefineError(
            rpt_("Only {good} of {count} frames of the plate could be refined; nothing was changed. {reason}", **values)
        )

    @property
    def median_depth(self) -> float:
        """Over all frames, in units of the splat's file; 0 where none tells it."""
        depths = [report.quality.median_depth for report in self.reports.values() if report.quality]
        return median(depths) if depths else 0.0

    @property
    def doubtful(self) -> dict[int, str]:
        """The keyed frames whose verdict is "check", each with its first reason."""
        found = {frame: report for frame, report in self.reports.items() if frame not in self.bad}
        return {frame: first_reason(report) for frame, report in found.items() if report.verdict == "check"}

    def summary(self) -> str:
        """Up to six sentences on all frames."""
        values = {"good": self.items - len(self.bad), "count": self.items}
        sentences = [rpt_("{good} of {count} frames of the plate were refined.", **values)]
        if self.items == 1:
            sentences = [rpt_("1 frame of the plate was refined.")]
        if self.lens_doubt:
            sentences.append(rpt_("The frame that the lens comes from is not trusted: {reason}", reason=self.lens_doubt))
        if self.unheld:
            sentences.append(rpt_("Keyed, but off the splat: {frames}.", frames=frame_list(self.unheld)))
        if self.doubtful:
            sentences.append(rpt_("Look at these before you rely on them: {frames}.", frames=frame_list(self.doubtful)))
        if self.bad:
            sentences.append(rpt_("Bad and not keyed: {frames}.", frames=frame_list(self.bad)))
        return " ".join(filter(None, [*sentences, self._renderer.remark]))

    def reasons(self) -> list[str]:
        """The summary, then why frames are bad or doubtful, a line for all frames of which the same is to be said."""
        return [self.summary(), *by_sentence(self.bad), *by_sentence(self.unheld), *by_sentence(self.doubtful)]
