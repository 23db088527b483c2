"""A moving plate tracked: every frame, from the one that is shown."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import bpy

from ....core.errors import RefineError
from ....core.geometry.camera import Camera, Pose
from ....core.locate import FindProgress
from ....core.photos.photo import Photo
from ....core.pose.report import RefineProgress, RefineReport
from ....core.pose.settings import RefineSettings
from ....core.track import (
    Earlier,
    PartialTrack,
    Shot,
    Track,
    TrackProgress,
    TrackSettings,
    iterate_again,
    iterate_track,
    track_of,
)
from ...camera import bridge as camera_bridge
from ...find import job as find_job
from ...jobs.machine import Job
from ...jobs.worker import RefineInputs
from ...photo import mask as mask_source
from ...splat.copy import SplatCopying
from ...splat.renderer import SplatRenderer
from ...support.texts import iface_, n_, rpt_
from .. import source as plate_source
from ..reader import PlateReader
from ..targets import PlateTargets
from .live import LiveCamera

log = logging.getLogger(__name__)
SEEN_FRAMES, SHORT_S = 5, 100  # frames that must have been tracked to tell the time; a longer one is told in minutes
START_SHARE = 0.1  # of the progress, when the first frame is solved


@dataclass(frozen=True)
class TrackOptions:
    """Frames of the scene from `start` to `end`. `live`: the camera is shown as it goes; `before`: the track of which they are
    a part to be made anew, None where the whole is made; `pinned`: poses that are held, world-to-camera in the coordinates of
    the splat's file, by frame.
    """

    start: int
    end: int
    settings: TrackSettings
    live: bool = False
    before: Track | None = None
    pinned: Mapping[int, Pose] = field(default_factory=dict)


class TrackJob(Job):
    """Solves the camera of the shown frame, in the whole scan where it is not found from where it stands, then tracks all
    frames from there. Its result is the Track.
    """

    status = n_("Tracking the plate    Esc: stop and keep what was tracked")

    def __init__(
        self, scene: bpy.types.Scene, camera: bpy.types.Object, options: TrackOptions, settings: RefineSettings
    ) -> None:
        plate, self.frame = plate_source.plate_of(camera), scene.frame_current
        self.plate = plate
        if not options.start <= self.frame <= options.end:
            values = {"frame": self.frame, "start": options.start, "end": options.end}
            raise RefineError(
                rpt_("Tracking begins at the frame that is shown, {frame}; go to one from {start} to {end}.", **values)
            )
        splat = scene.gssmc.splat
        copying = SplatCopying(splat)
        super().__init__(self._steps, copying)
        self.options, self._settings = options, settings
        self._reader = PlateReader(plate, mask_source.of(camera))
        self.targets = PlateTargets.of(scene, splat, camera)
        self._renderer = SplatRenderer(copying, settings.threads, keeps=True)
        self._finder = find_job.finder_of(scene, splat, self._renderer)
        copy = camera_bridge.read_camera(scene, camera, splat)
        if options.before is not None:  # The lens of the shot holds for its parts.
            copy, settings = replace(copy, solved=options.before.lens), replace(settings, lens="fixed")
        self._inputs = RefineInputs(self._renderer, self._reader.source(self.frame), copy, settings)
        self._live = LiveCamera(scene, camera) if options.live else None
        self.found = PartialTrack()
        self.reports: dict[int, RefineReport] = {}
        self._start: Camera | None = None
        self._told, self._began = find_job.Told(self._finder), time.perf_counter()

    def check(self) -> None:
        self.targets.find()

    def close(self) -> None:
        self._reader.stop()
        self._renderer.close()
        if self._live:
            try:
                self._live.put_back(self.targets.find())
            except RefineError:  # The camera is gone.
                log.info("The camera that was tracked is gone")

    def advance(self) -> Any:
        self._reader.serve()
        return super().advance()

    def on_progress(self, news: RefineProgress | FindProgress | TrackProgress) -> None:
        if isinstance(news, TrackProgress):
            self.fraction = START_SHARE + (1 - START_SHARE) * news.fraction
            self.step, self.detail = iface_("Frame {frame}", frame=news.frame), self._detail(news)
            if self._live and news.found is not None:
                self._live.show(self.targets.find(), news.frame, news.found.pose)
        elif isinstance(news, RefineProgress):
            self.fraction, self.step = START_SHARE * news.fraction, news.step[:1].upper() + news.step[1:]
            self.detail = iface_("The shown frame first")
        else:
            fraction, self.step, self.detail = self._told(news)
            self.fraction = START_SHARE * fraction

    def _detail(self, news: TrackProgress) -> str:
        """How many frames a second, and how long all would take."""
        seconds, count = time.perf_counter() - self._began, len(self.found.ties)
        values = {"count": count, "rate": count / max(seconds, 1e-6)}
        if news.fraction <= 0 or count < SEEN_FRAMES:
            return iface_("{count} tracked", **values)
        left = seconds * (1 - news.fraction) / news.fraction
        if left < SHORT_S:
            return iface_("{count} tracked, {rate:.1f} a second, about {left:.0f} s to go", left=left, **values)
        return iface_("{count} tracked, {rate:.1f} a second, about {left:.0f} min to go", left=math.ceil(left / 60), **values)

    def kept(self) -> Track | None:
        """What was tracked when the user stopped, None where that is too little to key. It works on what the thread has found
        so far, without waiting for it.
        """
        found = replace(self.found, ties=dict(self.found.ties), links=list(self.found.links), lost=dict(self.found.lost))
        if self._start is None or self.options.before is not None or len(found.ties) < 2:
            return None
        shot = replace(self._shot(), frames=range(min(found.ties), max(found.ties) + 1))
        return track_of(shot, self._start, self.options.settings, found, time.perf_counter() - self._began)

    def _shot(self) -> Shot:
        report = self.reports.get(self.frame)
        doubt = "" if report is None or report.verdict == "trusted" else report.reasons[0]
        frames = range(self.options.start, self.options.end + 1)
        return Shot(self._reader.read, frames, self._recovered, doubt=doubt, pinned=self.options.pinned)

    def _steps(self) -> Generator[object, None, Track]:
        """The whole work, in the thread. Raises RefineError where the shown frame was not found."""
        before = self.options.before
        report: RefineReport = yield from self._finder.found_if_failed(self._inputs)
        if report.verdict == "failed" and before is None:
            raise RefineError(report.reasons[0])
        self._began = time.perf_counter()
        starts = {}
        if report.verdict != "failed":
            self.reports[self.frame] = report
            # A lens that was guessed is solved for once more, from all frames.
            guessed = report.start.focal_guessed and self._settings.lens != "fixed"
            self._start = replace(report.camera, focal_guessed=guessed)
            starts[self.frame] = self._start
            starts |= {frame: replace(self._start, pose=pose) for frame, pose in self.options.pinned.items()}
        shot, settings, renderer = self._shot(), self.options.settings, self._renderer.get()
        if before is None:
            return (yield from iterate_track(renderer, shot, starts, settings, self.found))
        self._start = self._start or before.frames[0].camera
        return (yield from iterate_again(renderer, shot, Earlier(before, starts), settings, self.found))

    def _recovered(self, photo: Photo, last: Camera) -> Camera | None:
        """A frame behind a gap, refined from the last known camera."""
        from ....core.pose.refine import refine

        assert self._start is not None, "the first frame is solved before any other"
        camera = replace(self._start, pose=last.pose, intrinsics=last.intrinsics, focal_guessed=False)
        report = refine(self._renderer.get(), photo, camera, self._settings)
        return None if report.verdict == "failed" else report.camera
