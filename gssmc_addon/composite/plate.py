"""What the CG is laid over: the camera's photo or plate, at its own resolution, or a straight copy of the photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.errors import CameraError, PhotoError
from ...core.geometry.camera import Intrinsics
from ...core.photos.undistort import undistorted
from ..camera import bridge as camera_bridge
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..support.texts import rpt_


@dataclass(frozen=True)
class Backplate:
    """A photo, plate, movie clip, or render of the splat behind a camera: `image`, `clip` or `frames`, a folder; its lens at
    `size` (width, height).

    `user`: which frame of a moving image the background shows; `moves`: whether it is one.
    """

    image: bpy.types.Image | None
    clip: bpy.types.MovieClip | None
    user: bpy.types.ImageUser | None
    lens: Intrinsics
    frames: Path | None = None

    @property
    def name(self) -> str:
        if self.frames:
            return self.frames.name
        return self.image.name if self.image else self.clip.name if self.clip else ""

    @property
    def size(self) -> tuple[int, int]:
        return self.lens.width, self.lens.height

    @property
    def moves(self) -> bool:
        return self.image is None or self.image.source in plate_source.MOVING


def of_camera(scene: bpy.types.Scene, camera: bpy.types.Object) -> Backplate:
    """The camera's photo or plate. Raises CameraError when it has none, PhotoError when Blender cannot read it."""
    data = camera.data
    image = photo_image.camera_photo(camera)
    clip = next((slot.clip for slot in data.background_images if slot.source == "MOVIE_CLIP" and slot.clip), None)
    shown = image or clip
    if shown is None:
        raise CameraError(rpt_('The camera "{name}" has no photo; use Add Photo in the GS-SMC panel.', name=camera.name))
    width, height = _size(scene, camera, shown)
    user = next((slot.image_user for slot in data.background_images if image and slot.image == image), None)
    lens = camera_bridge.photo_intrinsics(scene, data, width, height)
    return Backplate(image, None if image else clip, user, lens)


def of_splat(scene: bpy.types.Scene) -> Backplate:
    """The rendered frames of the splat. Raises PhotoError when there are none, or some are missing."""
    kept = scene.gssmc.composite
    folder = Path(bpy.path.abspath(kept.frames_folder))
    width, height = kept.frames_size
    if not (width and height and frame_file(folder, kept.frames_range[0]).exists()):
        raise PhotoError(rpt_("No frames of the splat are rendered yet; use Render Splat first."))
    first, last = kept.frames_range
    gone = next((number for number in range(first, last + 1) if not frame_file(folder, number).exists()), None)
    if gone is not None:
        raise PhotoError(rpt_("Frame {number} of the splat is missing; use Render Splat again, which makes it.", number=gone))
    return Backplate(None, None, None, Intrinsics(width, height, width, width, width / 2, height / 2), folder)


def frame_file(folder: Path, frame: int) -> Path:
    """Where a rendered frame of the splat lies."""
    return folder / f"splat_{frame:04d}.exr"


def _size(scene: bpy.types.Scene, camera: bpy.types.Object, shown: bpy.types.Image | bpy.types.MovieClip) -> tuple[int, int]:
    """How many pixels Blender has of it. Of a sequence whose numbers do not begin at 1 it does not tell, so a frame is read."""
    width, height = (int(side) for side in shown.size)
    if width and height:
        return width, height
    moving = plate_source.moving_photo(camera) if getattr(shown, "source", "") in plate_source.MOVING else None
    if moving is None:
        raise PhotoError(rpt_('The file of "{name}" cannot be read; add the photo again.', name=shown.name))
    first, last = moving.scene_range
    photo = moving.frame_at(min(max(scene.frame_current, first), last)).read()
    return photo.width, photo.height


def straight_copy(plate: Backplate) -> bpy.types.Image:
    """A copy of the photo without its lens distortion, inside the .blend. Raises PhotoError where the photo moves."""
    if plate.image is None or plate.moves:
        raise PhotoError(rpt_("Only the frames of a still photo are undistorted here; bend the CG instead (Lens: On the CG)."))
    photo = photo_image.photo_source(plate.image).read()
    lens = plate.lens.resized(photo.width, photo.height)
    return photo_image.packed_copy(f"{plate.image.name} straight", undistorted(photo, lens))
