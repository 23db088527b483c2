"""Moving plates inside Blender: which frame of a sequence or movie a camera shows at a frame of the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.errors import PhotoError
from ...core.photos.photo import Photo
from ...core.photos.plate import DIGITS, Plate, behind_gaps, open_plate
from ..photo import image as photo_image
from ..photo.source import PhotoSource
from ..support.texts import rpt_

MOVING = ("SEQUENCE", "MOVIE")


@dataclass(frozen=True)
class FrameSource:
    """One frame of a plate; a PhotoSource. `decoded`: the frame, where only Blender decodes it (OpenEXR)."""

    plate: Plate
    number: int
    decoded: Photo | None = None

    @property
    def name(self) -> str:
        return f"{self.plate.path.name} {self.number}"

    @property
    def path(self) -> str:
        return str(self.plate.path)

    def read(self) -> Photo:
        """Decodes the frame; needs no Blender. Raises PhotoError."""
        return self.plate.read(self.number) if self.decoded is None else self.decoded


@dataclass(frozen=True)
class MovingPhoto:
    """A camera's plate: frame f of the scene shows frame f + `offset` of it, which exists from `first` to `last`.

    `colorspace`: the name of Blender's colour space that the user says its values are in.
    """

    plate: Plate
    offset: int
    first: int
    last: int
    colorspace: str = ""

    @property
    def scene_range(self) -> tuple[int, int]:
        """The frames of the scene that it covers."""
        return self.first - self.offset, self.last - self.offset

    @property
    def reach(self) -> tuple[int, int]:
        """The same with the files of a sequence that lie behind a gap, whose frames can be tracked over it."""
        beyond = behind_gaps(self.plate, *open_plate(self.plate.path)[1:])
        numbers = [self.first, self.last, *beyond]
        return min(numbers) - self.offset, max(numbers) - self.offset

    def frame_at(self, frame: int) -> FrameSource:
        """The frame of the scene's `frame`. Main thread only. Raises PhotoError when Blender has to decode it and can't."""
        return frame_source(self.plate, frame + self.offset, self.colorspace)


def frame_source(plate: Plate, number: int, colorspace: str = "") -> FrameSource:
    """The plate's frame, `colorspace` as in MovingPhoto. Main thread only. Raises PhotoError when it is OpenEXR and Blender
    can't decode it.
    """
    if plate.is_movie or not photo_image.is_linear(str(plate.file(number))):
        return FrameSource(plate, number)
    return FrameSource(plate, number, photo_image.read_linear(str(plate.file(number)), colorspace))


def moving_photo(camera: bpy.types.Object) -> MovingPhoto | None:
    """The camera's plate: an image sequence, a movie or a movie clip among its photo and backgrounds; None when it has none.

    Raises PhotoError when its file is gone.
    """
    image = photo_image.camera_photo(camera)
    slots = camera.data.background_images
    if image and image.source in MOVING:
        user = next((slot.image_user for slot in slots if slot.image == image), None)
        return _of_image(image, user)
    clip = next((slot.clip for slot in slots if slot.source == "MOVIE_CLIP" and slot.clip), None)
    return _of_clip(clip) if clip and image is None else None


def plate_of(camera: bpy.types.Object) -> MovingPhoto:
    """The camera's plate. Raises PhotoError where it has none, or its file is gone."""
    plate = moving_photo(camera)
    if plate is None:
        raise PhotoError(no_plate(camera))
    return plate


def has_clip(camera: bpy.types.Object) -> bool:
    """Whether a movie clip is behind the camera, and no photo."""
    clips = any(slot.source == "MOVIE_CLIP" and slot.clip for slot in camera.data.background_images)
    return clips and photo_image.camera_photo(camera) is None


def moves(camera: bpy.types.Object) -> bool:
    """Whether the camera has a plate; cheap, for it is asked at every redraw."""
    image = photo_image.camera_photo(camera)
    return image.source in MOVING if image else has_clip(camera)


def no_plate(camera: bpy.types.Object) -> str:
    """What to tell of a camera without a plate."""
    return rpt_('The camera "{name}" has no image sequence or movie; use Add Plate in the GS-SMC panel.', name=camera.name)


def _of_image(image: bpy.types.Image, user: bpy.types.ImageUser | None) -> MovingPhoto:
    plate, first, last = open_plate(bpy.path.abspath(image.filepath, library=image.library))
    colorspace = image.colorspace_settings.name
    if user is None:
        return MovingPhoto(plate, first - 1, first, last, colorspace)
    offset = user.frame_offset + 1 - user.frame_start
    low, high = user.frame_offset + 1, user.frame_offset + user.frame_duration
    return MovingPhoto(plate, offset, max(first, low), min(last, high), colorspace)


def _of_clip(clip: bpy.types.MovieClip) -> MovingPhoto:
    plate, first, last = open_plate(bpy.path.abspath(clip.filepath, library=clip.library))
    number = DIGITS.search(plate.path.stem)
    here = int(number.group()) if number and not plate.is_movie else 1
    offset = here - clip.frame_start + clip.frame_offset
    return MovingPhoto(plate, offset, first, last, clip.colorspace_settings.name)


def source_at(scene: bpy.types.Scene, camera: bpy.types.Object, photo: bpy.types.Image) -> PhotoSource:
    """Where the engine finds the camera's photo: the current frame where it moves. Raises PhotoError."""
    if photo.source not in MOVING:
        return photo_image.photo_source(photo)
    plate = moving_photo(camera)
    if plate is None:
        raise PhotoError(
            rpt_('The image "{name}" is not shown behind its camera; pick it as the photo again.', name=photo.name)
        )
    return plate.frame_at(scene.frame_current)


def load(path: Path, is_movie: bool) -> bpy.types.Image:
    """The plate as a Blender image."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.source = "MOVIE" if is_movie else "SEQUENCE"
    return image


def shot_name(path: Path) -> str:
    """The name of a plate without the number of its file: "shot" of shot.0012.png; a movie's name is its own.

    Where nothing but a number is left, it is the folder's.
    """
    number = None if path.suffix.lower() in bpy.path.extensions_movie else DIGITS.search(path.stem)
    bare = path.stem if number is None else path.stem[: number.start()] + path.stem[number.end() :]
    return (bare.strip("._- ") or path.parent.name or path.stem) + path.suffix


def set_frames(data: bpy.types.Camera, image: bpy.types.Image, start: int, first: int, last: int) -> None:
    """Makes the background of `image` show the plate's first frame at frame `start` of the scene."""
    user = next(slot.image_user for slot in data.background_images if slot.image == image)
    user.frame_start, user.frame_offset, user.frame_duration = start, first - 1, last - first + 1
    user.use_auto_refresh = True
