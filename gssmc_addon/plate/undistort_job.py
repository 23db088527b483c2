"""A plate without its lens distortion: an image sequence beside it, for the background and for other programs."""

from __future__ import annotations

import itertools
from collections.abc import Generator
from pathlib import Path
from typing import Any

import bpy
import cv2
import numpy as np

from ...core.errors import CameraError, PhotoError
from ...core.geometry.camera import Intrinsics
from ...core.photos.undistort import undistorted
from ...core.support.atomic import atomic_write
from ..camera import bridge as camera_bridge
from ..jobs.machine import Job
from ..photo import image as photo_image
from ..support.session_ids import by_uid
from ..support.texts import iface_, n_, rpt_
from . import source as plate_source
from .reader import PlateReader

DIGITS = 4


class UndistortJob(Job):
    """Writes the plate's frames, undistorted, into a folder. Its result is the path of the first file."""

    status = n_("Undistorting the plate    Esc: cancel")

    def __init__(self, scene: bpy.types.Scene, camera: bpy.types.Object, folder: Path) -> None:
        super().__init__(self._steps)
        plate = plate_source.plate_of(camera)
        self._reader, self.plate = PlateReader(plate, None), plate
        self.frames = range(plate.first, plate.last + 1)
        self._lens = _lens_of(scene, camera, self._reader, plate)
        self._files = [folder / f"{folder.name}.{number:0{DIGITS}d}.png" for number in self.frames]
        there = next((file for file in self._files if file.exists()), None)
        if there:
            raise PhotoError(rpt_("'{file}' is there already; choose an empty folder, or remove it.", file=there))
        self.camera = camera.session_uid
        self._written: list[Path] = []

    def check(self) -> None:
        if by_uid(bpy.data.objects, self.camera) is None:
            raise CameraError(rpt_("The camera was removed while its plate was undistorted."))

    def advance(self) -> Any:
        self._reader.serve()
        return super().advance()

    def cancel(self) -> None:
        """Takes back what was written, for half a sequence is none."""
        super().cancel()
        self._reader.stop()
        for file in self._written:
            file.unlink(missing_ok=True)

    def on_progress(self, news: int) -> None:
        self.fraction, self.step = news / len(self.frames), iface_("Undistorting")
        self.detail = iface_("{number} of {count}", number=news, count=len(self.frames))

    def _steps(self) -> Generator[int, None, Path]:
        for done, (number, file) in enumerate(zip(self.frames, self._files, strict=True), 1):
            photo = undistorted(self._reader.read(number - self.plate.offset), self._lens)
            ok, data = cv2.imencode(".png", np.ascontiguousarray(photo.pixels[..., ::-1]))
            if not ok:
                raise PhotoError(rpt_("Frame {number} could not be made a PNG; choose another plate.", number=number))
            self._written.append(file)
            try:
                with atomic_write(file, "wb", one_of_many=True) as out:
                    out.write(data.tobytes())
            except OSError as error:
                values = {"path": file, "reason": error.strerror}
                raise PhotoError(rpt_("'{path}' cannot be written ({reason}); choose another place.", **values)) from error
            if self.cancelled:  # Cancelling may have come while the file was written.
                file.unlink(missing_ok=True)
            yield done
        return self._files[0]


def _lens_of(
    scene: bpy.types.Scene, camera: bpy.types.Object, reader: PlateReader, plate: plate_source.MovingPhoto
) -> Intrinsics:
    """The plate's lens. Raises CameraError where it has no distortion, PhotoError where its first frame is gone."""
    photo = reader.read(plate.scene_range[0])
    lens = camera_bridge.photo_intrinsics(scene, camera.data, photo.width, photo.height)
    if not lens.has_distortion:
        text = rpt_('The camera "{name}" has no lens distortion; set k1 in the Lens panel, or solve for it.', name=camera.name)
        raise CameraError(text)
    return lens


def default_folder(camera: bpy.types.Object) -> Path:
    """A folder beside the plate that is not there yet. Raises PhotoError where the camera has no plate."""
    plate = plate_source.plate_of(camera)
    wanted = Path(plate_source.shot_name(plate.plate.path)).stem + " undistorted"
    names = (wanted if n == 1 else f"{wanted} {n}" for n in itertools.count(1))
    return next(folder for folder in (plate.plate.path.parent / name for name in names) if not folder.exists())


def show(camera: bpy.types.Object, plate: plate_source.MovingPhoto, first_file: Path) -> bpy.types.Image:
    """Shows the undistorted sequence in place of the plate, whose own background, which says which frame is shown when, is
    hidden.
    """
    data, image = camera.data, plate_source.load(first_file, is_movie=False)
    old = data.gssmc.undistorted
    slots = data.background_images
    slot = next((s for s in slots if s.image and s.image == old), None) or slots.new()
    for other in slots:
        other.show_background_image = False
    slot.source, slot.image, slot.show_background_image = "IMAGE", image, True
    slot.alpha, slot.display_depth = photo_image.BACKGROUND_ALPHA, "FRONT"
    plate_source.set_frames(data, image, plate.scene_range[0], plate.first, plate.last)
    data.show_background_images, data.gssmc.undistorted = True, image
    if old is not None and old.users == 0:
        bpy.data.images.remove(old)
    return image
