"""A moving plate refined: every Nth frame in a queue, each from its neighbour's answer, and the keys that come of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
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
from ..find import job as find_job
from ..jobs.retries import RetryQueue
from ..jobs.worker import RefineInputs, Steps, refinement
from ..photo import mask as mask_source
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.texts import iface_, n_, rpt_
from . import source as plate_source
from .options import SequenceOptions
from .targets import PlateTargets

DOUBT = 0.25  # The weight of a frame whose verdict is "check".
SHOWN_FRAMES = 12
FIGURES = re.compile(r"\d+(\.\d+)?")


class SequenceJob(RetryQueue):
    """Refines the frames outward from the current one; those of which no camera was found again from solved ones beside them.

    Its result is the job itself; `path()` makes the keys of it.
    """

    status = n_("Refining the plate    Esc: cancel")

    def __init__(
        self, scene: bpy.types.Scene, camera: bpy.types.Object, options: SequenceOptions, settings: RefineSettings
    ) -> None:
        plate = plate_source.moving_photo(camera)
        if plate is None:
            raise PhotoError(plate_source.no_plate(camera))
        self._plate = plate
        splat = scene.gssmc.splat
        frames = sequence.keyframes(options.start, options.end, options.step)
        copying = SplatCopying(splat)
        super().__init__(len(frames), copying)
        self.options, self.settings, self.camera_name = options, settings, camera.name
        self.order = sequence.outward(frames, scene.frame_current)
        self.reports: dict[int, RefineReport] = {}
        self.bad: dict[int, str] = {}
        self._started: dict[int, int | None] = {}  # The frame whose camera was the start of a frame's first try.
        self._sought = False  # Whether a frame was looked for in the whole scan.
        self.targets = PlateTargets.of(scene, splat, camera)
        self._mask = mask_source.of(camera)
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
        source = mask_source.masked(self._plate.frame_at(frame), self._mask)
        inputs = RefineInputs(self._renderer, source, camera, self.settings)
        if near is None and self.options.find_start and not self._sought:
            self._sought = True  # It takes long, and where one frame cannot be found, no other of the shot can.
            return partial(self._finder.found_if_failed, inputs)
        return partial(refinement, inputs)

    def on_progress(self, news: RefineProgress) -> None:
        self.fraction = self.progress(news.fraction)

    def end_try(self, item: int, start: int | None, report: RefineReport) -> bool:
        frame = self.order[item]
        if report.verdict != "failed":
            self.reports[frame] = report
            self.bad.pop(frame, None)
        elif start is None:
            self.bad[frame] = _first_reason(report)
        return report.verdict != "failed"

    def fail_try(self, item: int, start: int | None, message: str) -> None:
        self.bad.setdefault(self.order[item], message)

    def other_starts(self, item: int) -> list[int]:
        """The nearest solved frames before and after, but for the one that was the start already."""
        frame = self.order[item]
        sides = [f for f in self.reports if f < frame], [f for f in self.reports if f > frame]
        near = [sequence.nearest(frame, side) for side in sides]
        return [f for f in near if f is not None and f != self._started[frame]]

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
            nearest = [sequence.nearest(frame, frames) for frame in filled]
            # It is never None, because `frames` holds at least two.
            lenses = [self.reports[near].camera for near in nearest if near is not None]
            frames, poses = filled, sequence.interpolate(smoothed, filled)
        return {frame: replace(lens, pose=pose) for frame, lens, pose in zip(frames, lenses, poses, strict=True)}

    @property
    def median_depth(self) -> float:
        """Over all frames, in units of the splat's file; 0 where none tells it."""
        depths = [report.quality.median_depth for report in self.reports.values() if report.quality]
        return median(depths) if depths else 0.0

    @property
    def doubtful(self) -> dict[int, str]:
        """The keyed frames whose verdict is "check", each with its first reason."""
        found = {frame: report for frame, report in self.reports.items() if frame not in self.bad}
        return {frame: _first_reason(report) for frame, report in found.items() if report.verdict == "check"}

    def summary(self) -> str:
        """Up to three sentences on all frames."""
        values = {"good": self.items - len(self.bad), "count": self.items}
        sentences = [rpt_("{good} of {count} frames of the plate were refined.", **values)]
        if self.items == 1:
            sentences = [rpt_("1 frame of the plate was refined.")]
        if self.doubtful:
            sentences.append(rpt_("Look at these before you rely on them: {frames}.", frames=frame_list(self.doubtful)))
        if self.bad:
            sentences.append(rpt_("Bad and not keyed: {frames}.", frames=frame_list(self.bad)))
        return " ".join(sentences)

    def reasons(self) -> list[str]:
        """The summary, then why frames are bad or doubtful, a line for all frames of which the same is to be said."""
        return [self.summary(), *by_sentence(self.bad), *by_sentence(self.doubtful)]


def _first_reason(report: RefineReport) -> str:
    return report.reasons[0] if report.reasons else rpt_("No camera was found.")


def by_sentence(frames: Mapping[int, str]) -> list[str]:
    """A line for each sentence with its frames. Sentences that differ in their figures alone share one, with the first's."""
    groups: dict[str, list[int]] = {}
    for frame in sorted(frames):
        groups.setdefault(FIGURES.sub("0", frames[frame]), []).append(frame)
    lines = []
    for same in groups.values():
        values = {"frames": frame_list(same), "first": same[0], "reason": frames[same[0]]}
        if len(same) == 1:
            lines.append(rpt_("Frame {frames}: {reason}", **values))
        elif len({frames[frame] for frame in same}) == 1:
            lines.append(rpt_("Frames {frames}: {reason}", **values))
        else:
            lines.append(rpt_("Frames {frames}, with the figures of {first}: {reason}", **values))
    return lines


def frame_list(frames: Iterable[int]) -> str:
    """The frames in words, the first dozen of them."""
    numbers = sorted(frames)
    shown = ", ".join(map(str, numbers[:SHOWN_FRAMES]))
    more = len(numbers) - SHOWN_FRAMES
    return rpt_("{frames} and {count} more", frames=shown, count=more) if more > 0 else shown
