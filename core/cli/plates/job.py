"""One plate tracked: from its file to TRACK.json, with a journal from which the same command goes on."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...batch.place import starts_in_scene
from ...cameras.training_world import ScanAxes
from ...cameras.unplaced import Unplaced
from ...errors import CameraError, PhotoError
from ...geometry.camera import Camera, Pose
from ...photos.frame_rate import movie_frame_rate
from ...support.sealed import sealed
from ...support.words import counted
from ...track import Earlier, PartialTrack, Shot, Track, Tracking, TrackSettings, iterate_again, iterate_track
from ...track.file import track_to_dict
from ...track.journal import read_found, write_found
from ..commands.refine import pick_wanted, wanted_camera
from ..console import message
from ..progress import ProgressBar
from ..result import write_json
from ..shots import PlateFrames, ShotWork

JOURNAL = ".journal"
SAVE_EVERY_S = 60.0
KEY = "key"


def journal_of(out: Path) -> Path:
    return out.with_name(out.name + JOURNAL)


@dataclass(frozen=True)
class ShotJob:
    """What is to be tracked: `frames` in order; camera files by frame of `starts`, and of `pins`, whose poses are held; the
    track `before` of which these frames are made anew, in the coordinates of the scan's file, None where there is none;
    `out`: the file to write; `key` of what the answer depends on.
    """

    photos: PlateFrames
    frames: range
    starts: dict[int, Path]
    pins: dict[int, Path]
    before: Track | None
    settings: TrackSettings
    out: Path
    key: str

    def run(self, work: ShotWork) -> Track:
        """Tracks the plate and writes the file. Raises GssmcError, OSError; KeyboardInterrupt after the journal is written."""
        journal, found = journal_of(self.out), read_found(journal_of(self.out), self.key)
        if found.ties:
            message(f"{len(found.ties)} of {counted(len(self.frames), 'frame')} were found before and are kept.")
        try:
            track = self._followed(self._steps(work, found), found)
        except KeyboardInterrupt:
            write_found(journal, found, self.key)
            message(f"Interrupted; {counted(len(found.ties), 'frame')} found, in '{journal}'. The same command goes on.")
            raise
        record = track_to_dict(moved(track, [-value for value in work.scene.origin]))
        write_json(self.out, sealed({**record, "plate": self._about(work, track), KEY: self.key}))
        journal.unlink(missing_ok=True)
        return track

    def _steps(self, work: ShotWork, found: PartialTrack) -> Tracking:
        pinned = {frame: _pose(work, frame, file) for frame, file in self.pins.items()}
        shot = Shot(work.frames.read, self.frames, work.recover, work.frames.name, pinned=pinned)
        if self.before is None:
            starts = work.starts(self.frames, self.starts or self.pins)
            shot = replace(shot, doubt=" ".join(work.doubts))
            return iterate_track(work.renderer, shot, starts, self.settings, found)
        starts = work.starts(self.frames, self.starts) if self.starts else {}
        shot = replace(shot, doubt=" ".join(work.doubts))
        earlier = Earlier(moved(self.before, work.scene.origin), starts)
        return iterate_again(work.renderer, shot, earlier, self.settings, found)

    def _followed(self, steps: Tracking, found: PartialTrack) -> Track:
        """The work to its end, with progress, saved from time to time."""
        saved = time.monotonic()
        with ProgressBar("Tracking") as bar:
            while True:
                try:
                    step = next(steps)
                except StopIteration as end:
                    track: Track = end.value
                    return track
                bar.show(step.fraction, f"frame {step.frame}")
                if time.monotonic() - saved > SAVE_EVERY_S:
                    write_found(journal_of(self.out), found, self.key)
                    saved = time.monotonic()

    def _about(self, work: ShotWork, track: Track) -> dict[str, Any]:
        """What is known of the plate beside its cameras."""
        tied = [frame.frame for frame in track.frames if frame.state != "lost" and frame.frame in self.frames]
        speed, aspect = movie_frame_rate(self.photos.plate.path) if self.photos.plate.is_movie else None, None
        with suppress(PhotoError):
            aspect = round(work.frames.read(tied[0]).pixel_aspect, 6) if tied else None
        return {
            "file": str(self.photos.plate.path),
            "fps": None if speed is None else round(float(speed), 6),
            "fps_exact": None if speed is None else f"{speed.numerator}/{speed.denominator}",
            "pixel_aspect": aspect,
        }


def moved(track: Track, origin: Any) -> Track:
    """The track among points of which `origin` (3,) was subtracted."""
    frames = tuple(replace(frame, camera=frame.camera.relative_to(origin)) for frame in track.frames)
    return replace(track, frames=frames)


def _pose(work: ShotWork, frame: int, file: Path) -> Pose:
    """The pose of a pinned frame, which need not be readable, among the means of the scene. Raises CameraError where the file
    tells none.
    """
    told = pick_wanted(file, work.frames.plate.file(frame))
    try:
        wanted = wanted_camera(told, work.frames.read(frame))
    except PhotoError:
        wanted = told if isinstance(told, Unplaced) else told.known_camera()
    if not isinstance(wanted, Camera):
        raise CameraError(f"The camera in '{file.name}' has no R and t, so that it cannot be pinned; give one with a pose.")
    return starts_in_scene(wanted, ScanAxes.of(work.scene), work.axes, work.scene.origin)[0][0].pose
