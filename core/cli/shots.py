"""What tracking a plate needs beside the tracker: its frames with their masks, starts to track from, and frames found anew."""

from __future__ import annotations

import errno
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..batch.keys import Stamp, stamp
from ..batch.refine_one import refine_photo
from ..cameras.training_world import Axes
from ..cameras.unplaced import Unplaced
from ..errors import PhotoError, RefineError, UsageError
from ..geometry.camera import Camera
from ..photos.mask import find_mask, masked
from ..photos.photo import Photo
from ..photos.plate import Plate
from ..pose.settings import RefineSettings
from ..render import ProcessRenderer
from ..splats import GaussianScene
from .commands.refine import Placing, pick_wanted, wanted_camera
from .console import message
from .maps import MapFlags

CHANGED = "it or its mask was changed while the plate was tracked"
# Where a start is looked for when none is given: these shares of the way through the shot.
LOOKED_AT = (0.5, 0.25, 0.75, 0.0, 1.0)


@dataclass(frozen=True)
class PlateFrames:
    """Reads a plate's frames with their masks, as files `name` them. `seen`: what the files of frame and mask were, by frame,
    for those that must not change while they are tracked.
    """

    plate: Plate
    masks: Path | None
    seen: Mapping[int, tuple[Stamp, Stamp]] = field(default_factory=dict)

    def seen_now(self, frames: Sequence[int]) -> PlateFrames:
        """The same, with these frames as they are now."""
        return replace(self, seen={frame: self._stamps(frame) for frame in frames})

    def name(self, frame: int) -> str:
        return str(self.plate.file(frame))

    def read(self, frame: int) -> Photo:
        """Raises PhotoError, and OSError, which ends the whole track, where a file is not what it was."""
        try:
            photo, mask = self.plate.read(frame), self.mask(frame)
            return photo if mask is None else masked(photo, mask)
        finally:  # Also where it cannot be read: a frame that is just being written must not count as one that is lost.
            if self.seen.get(frame, self._stamps(frame)) != self._stamps(frame):
                raise OSError(errno.EIO, CHANGED, self.name(frame))

    def _stamps(self, frame: int) -> tuple[Stamp, Stamp]:
        mask = self.mask(frame)
        return stamp(self.plate.file(frame)), None if mask is None else stamp(mask)

    def mask(self, frame: int) -> Path | None:
        """The file of the frame's mask; None where there is none."""
        return None if self.masks is None else find_mask(self.masks, self.plate.file(frame))


@dataclass(frozen=True)
class ShotWork:
    """What every step needs. `flags` None: no frame is searched for in the scan's map; `axes`: those of starts; `zooms`:
    the focal length may change; `doubts`: why starts are not trusted.
    """

    scene: GaussianScene
    renderer: ProcessRenderer
    settings: RefineSettings
    frames: PlateFrames
    flags: MapFlags | None
    axes: Axes = "auto"
    zooms: bool = False
    doubts: list[str] = field(default_factory=list)

    def starts(self, frames: Sequence[int], files: Mapping[int, Path]) -> dict[int, Camera]:
        """Solved cameras to begin with, in the scene's coordinates. Raises RefineError where there are none."""
        if files:
            return self._given(files)
        if self.flags is None:
            raise UsageError("There is no start to track from; give one with --start, or leave out --no-locate.")
        reason = ""
        for share in LOOKED_AT:
            frame = frames[round(share * (len(frames) - 1))]
            try:
                return {frame: self._placed(frame, None)}
            except (RefineError, PhotoError) as error:
                reason = str(error)
        raise RefineError(f"No frame was found in the scan; give a start with --start. {reason}")

    def _given(self, files: Mapping[int, Path]) -> dict[int, Camera]:
        """The starts given that can be placed; of the others is said why not. Raises RefineError, PhotoError where none
        can, CameraError.
        """
        found: dict[int, Camera] = {}
        errors: list[RefineError | PhotoError] = []
        for frame, file in sorted(files.items()):
            try:
                found[frame] = self._placed(frame, file)
            except (RefineError, PhotoError) as error:
                errors.append(error)
        if not found:
            raise errors[0]
        for failed in errors:
            message(f"A start is left out: {failed}")
        return found

    def _placed(self, frame: int, file: Path | None) -> Camera:
        photo = self.frames.read(frame)
        told = Unplaced() if file is None else pick_wanted(file, self.frames.plate.file(frame))
        wanted = wanted_camera(told, photo)
        placed = Placing(self.renderer, self.scene, self.settings, self.flags).place(photo, wanted, self.axes)
        if placed.report is None or placed.record["verdict"] == "failed":
            raise RefineError(f"Frame {frame} was not placed: {placed.record['reasons'][0]}")
        verdict, reason = placed.record["verdict"], placed.record["reasons"][0]
        message(f"The start, frame {frame}, by itself: {verdict}. {reason}")
        if verdict != "trusted":
            self.doubts.append(f"The camera of frame {frame}, which the tracking began at, is to be checked: {reason}")
        # A lens that was guessed is solved for once more, from all frames.
        guessed = self.settings.lens == "full" or (self.settings.lens != "fixed" and placed.report.start.focal_guessed)
        return replace(placed.report.camera, focal_guessed=guessed)

    def recover(self, photo: Photo, last: Camera) -> Camera | None:
        """A frame behind a gap, from the last known camera, else from anywhere in the scan. Where the lens zooms, its focal
        length may have changed meanwhile.
        """
        known = replace(last, focal_guessed=self.zooms, file=photo.file)
        fixed = replace(self.settings, lens="focal" if self.zooms else "auto")
        report = refine_photo(self.renderer, photo, known, fixed)
        if report.verdict != "failed" or self.flags is None:
            return None if report.verdict == "failed" else report.camera
        placed = Placing(self.renderer, self.scene, fixed, self.flags).place(photo, Unplaced.of(known))
        return None if placed.report is None or placed.record["verdict"] == "failed" else placed.report.camera
