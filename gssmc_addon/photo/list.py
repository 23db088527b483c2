"""The scene's list of photos, and the one that is selected."""

from __future__ import annotations

import bpy
import cv2
import numpy as np

from ...core.photos.photo import Photo
from ..camera import frame as camera_frame
from ..camera import solution as camera_solution
from ..look import cameras as look_cameras
from ..look import looks
from . import camera as photo_camera
from . import image as photo_image
from .entry import GssmcPhoto

THUMBNAIL_PX = 64


def camera_of(scene: bpy.types.Scene, entry: GssmcPhoto) -> bpy.types.Object | None:
    """The entry's camera, None when it has none or the user has deleted it (the list keeps it alive in the file)."""
    return entry.camera if entry.camera and entry.camera.name in scene.objects else None


def cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The cameras of the list's photos, in its order."""
    return [camera for camera in (camera_of(scene, entry) for entry in scene.gssmc.photos) if camera]


def poll(operator: type[bpy.types.Operator], scene: bpy.types.Scene) -> bool:
    """Whether the list has photos, for an operator that needs some; it says so where not."""
    if not cameras(scene):
        operator.poll_message_set("There are no photos on the list; use Add Photos first")
        return False
    return True


def is_open(entry: GssmcPhoto) -> bool:
    """Whether the camera of the photo is still to be found: it is not trusted."""
    return camera_solution.verdict(entry.id_data, entry.camera) != "TRUSTED"


def open_count(scene: bpy.types.Scene) -> int:
    """How many photos of the list, with a camera, are still to be found."""
    return sum(camera_of(scene, entry) is not None and is_open(entry) for entry in scene.gssmc.photos)


def title(entry: GssmcPhoto) -> str:
    """What the list shows of the entry: its camera's name, or the file's where no camera could be made of it."""
    return entry.camera.name if entry.camera else entry.file


def find(scene: bpy.types.Scene, camera: bpy.types.Object) -> GssmcPhoto | None:
    """The entry of a camera."""
    return next((entry for entry in scene.gssmc.photos if entry.camera == camera), None)


def add(scene: bpy.types.Scene, camera: bpy.types.Object, photo: Photo) -> GssmcPhoto:
    """The entry of a camera that was just given its photo; a new one where it has none yet."""
    entry = find(scene, camera) or scene.gssmc.photos.add()
    entry.camera, entry.error, entry.note, entry.file = camera, "", "", ""
    look_cameras.take_in(scene, camera)
    looks.show_photo(scene, camera)
    image = photo_image.camera_photo(camera)
    if image:
        _set_thumbnail(image, photo)
    return entry


def pick(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Selects a camera's entry; its update function then looks through the camera."""
    scene.gssmc.photo_index = next(i for i, entry in enumerate(scene.gssmc.photos) if entry.camera == camera)


def add_unreadable(scene: bpy.types.Scene, name: str, message: str) -> GssmcPhoto:
    """A line for a photo that has no camera because it could not be used."""
    entry = scene.gssmc.photos.add()
    entry.file, entry.error, entry.ticked = name, message, False
    return entry


def files(scene: bpy.types.Scene) -> set[str]:
    """The files of the photos that are on the list with a camera."""
    images = [image for image in map(photo_image.camera_photo, cameras(scene)) if image]
    return {photo_image.photo_file(image) for image in images}


def show(context: bpy.types.Context, scene: bpy.types.Scene) -> bool:
    """Looks through the camera of the picked entry. False when it has none."""
    photos, index = scene.gssmc.photos, scene.gssmc.photo_index
    camera = camera_of(scene, photos[index]) if 0 <= index < len(photos) else None
    if camera is None:
        return False
    left = photo_image.camera_photo(scene.camera) if scene.camera and scene.camera.type == "CAMERA" else None
    image = photo_image.camera_photo(camera)
    scene.camera = camera
    looks.show_photo(scene, camera)
    camera_frame.follow(scene)
    context.view_layer.update()  # A camera that was just linked is not in the view layer yet.
    look_cameras.show_one(scene, context.view_layer)
    if camera_solution.verdict(scene, camera) in ("TRUSTED", "CHECK", "PINNED"):
        photo_camera.stop_moving_with_view()
    if camera.name in context.view_layer.objects:
        photo_camera.look_through(context, camera)
    if left and left != image and not left.is_dirty:
        left.buffers_free()  # The pixels are released, or hundreds of photos would fill the memory.
    return True


def thumbnail(entry: GssmcPhoto) -> int:
    """The icon of an entry's photo, 0 when there is none."""
    image = photo_image.camera_photo(entry.camera) if entry.camera else None
    return image.preview.icon_id if image and image.preview else 0


def _set_thumbnail(image: bpy.types.Image, photo: Photo) -> None:
    """Makes a small picture ourselves, because Blender would read the whole photo again and keep it."""
    height, width = photo.pixels.shape[:2]
    scale = THUMBNAIL_PX / max(width, height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(photo.pixels, size, interpolation=cv2.INTER_AREA)
    square = np.zeros((THUMBNAIL_PX, THUMBNAIL_PX, 4), np.float32)
    x, y = (THUMBNAIL_PX - size[0]) // 2, (THUMBNAIL_PX - size[1]) // 2
    square[y : y + size[1], x : x + size[0], :3] = small[::-1].astype(np.float32) / 255
    square[y : y + size[1], x : x + size[0], 3] = 1
    preview = image.preview_ensure()
    for kind in ("icon", "image"):
        setattr(preview, f"{kind}_size", (THUMBNAIL_PX, THUMBNAIL_PX))
        getattr(preview, f"{kind}_pixels_float").foreach_set(square.ravel())
