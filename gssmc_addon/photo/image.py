"""Photographs inside Blender: loaded upright, set behind a camera, and found again for the engine."""

from __future__ import annotations

import logging
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import PhotoError
from ...core.photos.containers.exr_header import HEADER_BYTES, pixel_aspect
from ...core.photos.linear import photo_from_linear
from ...core.photos.photo import Photo, photo_facts, read_photo
from ...core.photos.size import EXR_SIGNATURE
from ..support.texts import rpt_

log = logging.getLogger(__name__)

FILE_KEY = "gssmc_file"
# Kinds of files that every Blender shows; of others (AVIF, HEIC, JPEG XL, raw photos) a copy is made.
READ_BY_BLENDER = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".exr")
# Of a background image: frame method, offset x and y, scale in the photo's frame, rotation, flips along x and y.
STRAIGHT = ("FIT", 0.0, 0.0, 1.0, 0.0, False, False)
SCALE_DIGITS = 5  # Blender stores the scale as float32.
BACKGROUND_ALPHA = 0.5  # the photo lies half-transparent over the splat, so that a misfit shows


@dataclass(frozen=True)
class ImageSource:
    """Where the engine finds a Blender image's pixels: a file, the bytes packed into the .blend, or for OpenEXR, which only
    Blender decodes, its `light` (H, W, 4) float32, in the scene's linear light, and the shape of its pixels.
    """

    name: str
    path: str
    packed: bytes | None = None
    light: np.ndarray | None = None
    pixel_aspect: float = 1.0

    def read(self) -> Photo:
        """Decodes the photo; needs no Blender, hence fit for a worker thread. Raises PhotoError."""
        if self.light is not None:
            return photo_from_linear(self.light, self.path, self.pixel_aspect)
        if self.packed is None:
            return read_photo(self.path)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / (Path(self.path).name or "photo.png")
            file.write_bytes(self.packed)
            return read_photo(file)


def photo_source(image: bpy.types.Image) -> ImageSource:
    """Copies what is needed to read the image later. Raises PhotoError when it has no pixels of its own."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE" and is_exr(image, path):
        return ImageSource(image.name, path, light=_light(image), pixel_aspect=_pixel_aspect(image, path))
    if image.packed_file:
        return ImageSource(image.name, path, bytes(image.packed_file.data))
    if image.source != "FILE" or not path:
        raise PhotoError(rpt_('The image "{name}" is not a photo file; add the photo with Add Photo.', name=image.name))
    return ImageSource(image.name, path)


def read_any_photo(path: str) -> Photo:
    """The photo in a file of any format that the engine or Blender decodes. Main thread only. Raises PhotoError."""
    if not is_linear(path):
        return read_photo(path)
    before = set(bpy.data.images)
    image = bpy.data.images.load(path, check_existing=True)
    try:
        return photo_from_linear(_light(image), path, _pixel_aspect(image, path))
    except PhotoError:
        if image not in before:
            bpy.data.images.remove(image)
        raise


def read_linear(path: str, colorspace: str = "") -> Photo:
    """The photo in an OpenEXR file, of which nothing stays in Blender. Main thread only. Raises PhotoError.

    `colorspace`: the name of Blender's colour space that the file's values are in; empty: the one that Blender takes.
    """
    image = bpy.data.images.load(path, check_existing=False)
    try:
        if colorspace and image.colorspace_settings.name != colorspace:
            image.colorspace_settings.name = colorspace
        return photo_from_linear(_light(image), path, _pixel_aspect(image, path))
    finally:
        bpy.data.images.remove(image)


def is_linear(path: str) -> bool:
    """Whether the file is an OpenEXR picture, which only Blender decodes; False where it cannot be read at all."""
    try:
        with open(path, "rb") as file:
            return file.read(len(EXR_SIGNATURE)) == EXR_SIGNATURE
    except OSError:
        return False  # The engine reports what is wrong with the file.


def is_exr(image: bpy.types.Image, path: str) -> bool:
    """Whether the first bytes are OpenEXR's. Asking Blender for the format would make it decode and keep the whole photo."""
    return bytes(image.packed_file.data).startswith(EXR_SIGNATURE) if image.packed_file else is_linear(path)


def _pixel_aspect(image: bpy.types.Image, path: str) -> float:
    """What the header of an OpenEXR image says of its pixels' shape; Blender reads past it."""
    if image.packed_file:
        return pixel_aspect(bytes(image.packed_file.data)[:HEADER_BYTES])
    try:
        with open(path, "rb") as file:
            return pixel_aspect(file.read(HEADER_BYTES))
    except OSError:
        return 1.0


def _light(image: bpy.types.Image) -> np.ndarray:
    """Linear pixels (H, W, 4), the top row first. Raises PhotoError when Blender can't decode the image."""
    width, height = image.size
    if not width or not height or len(image.pixels) != 4 * width * height:
        raise PhotoError(
            rpt_(
                'The OpenEXR image "{name}" has no plain picture that Blender can read; save it as one layer.', name=image.name
            )
        )
    values = np.empty(4 * width * height, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)[::-1]


def load_image(path: str, photo: Photo) -> bpy.types.Image:
    """The Blender image of a photo, upright. `photo` is what the engine read from `path`."""
    image = bpy.data.images.load(path, check_existing=True)
    # Blender ignores EXIF rotation; the engine does not.
    if not photo.stored_upright or tuple(image.size) != (photo.width, photo.height):
        if image.users == 0:
            bpy.data.images.remove(image)
        image = packed_copy(Path(path).name, photo)
        image[FILE_KEY] = path  # The packed copy does not know which file it was made from.
    return image


def load_cut(path: str, photo: Photo) -> bpy.types.Image:
    """An image inside the .blend of a picture that was cut out of the photo in a file."""
    return packed_copy(f"{Path(path).stem} cut", photo)


def packed_copy(name: str, photo: Photo) -> bpy.types.Image:
    """A new image inside the .blend with the photo's pixels, transparent where its mask leaves them out."""
    height, width = photo.pixels.shape[:2]  # Blender loads a very large photo with fewer pixels than the file has.
    image = bpy.data.images.new(Path(name).stem + ".png", width, height)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = photo.pixels[::-1].astype(np.float32) / 255  # Blender stores the bottom row first.
    if photo.mask is not None:
        pixels[..., 3] = photo.mask[::-1]
    image.pixels.foreach_set(pixels.ravel())
    image.file_format = "PNG"
    image.pack()
    return image


def camera_photo(camera: bpy.types.Object) -> bpy.types.Image | None:
    """The photo that belongs to a camera: the one picked in the panel, else its first background image."""
    return photo_of(camera.data)


def photo_of(data: bpy.types.Camera) -> bpy.types.Image | None:
    """As `camera_photo`, of the camera's data."""
    if data.gssmc.photo:
        return data.gssmc.photo
    shown = (b.image for b in data.background_images if b.source == "IMAGE" and b.image)
    return next((image for image in shown if image != data.gssmc.undistorted), None)


def photo_file(image: bpy.types.Image) -> str:
    """The file that a photo came from, also of a copy inside the .blend; "" when it came from none."""
    return bpy.path.abspath(image.filepath_raw or image.get(FILE_KEY, ""), library=image.library)


def orientation_in_file(image: bpy.types.Image) -> int:
    """The EXIF orientation (1..8) with which the file stores its pixels; 1 where there is no file that tells one."""
    try:
        return photo_facts(photo_file(image)).orientation
    except PhotoError:
        return 1


def own_size(data: bpy.types.Camera) -> tuple[int, int]:
    """(width, height) of the camera's photo upright, in its own file, of which Blender may hold a smaller copy.

    (0, 0) where there is no photo, or its file is gone and Blender has no pixels of it either.
    """
    props, image = data.gssmc, photo_of(data)
    kept = props.photo_x, props.photo_y
    known = all(kept) and props.framed == image
    if image is None or (known and not image.has_data):
        return kept if known else (0, 0)
    if known and _same_shape(tuple(image.size), kept):
        return kept
    return _size_in_file(image)


def _same_shape(a: tuple[int, int], b: tuple[int, int]) -> bool:
    """Compares the shapes, but for the pixel that halving a side may lose."""
    return abs(a[0] * b[1] - a[1] * b[0]) <= max(*a, *b)


def _size_in_file(image: bpy.types.Image) -> tuple[int, int]:
    """Reads the size from the file's first bytes; where they do not hold it, Blender decodes the whole file."""
    file = photo_file(image)
    if image.source == "FILE" and Path(file).is_file() and not is_exr(image, file):
        try:
            facts = photo_facts(file)
            return facts.width, facts.height
        except PhotoError as error:
            log.info("The size of %s is Blender's: %s", image.name, error)
    return tuple(image.size)


def show_behind(data: bpy.types.Camera, image: bpy.types.Image) -> None:
    """Makes `image` the camera's background, in the slot that already shows it where there is one."""
    slots = data.background_images
    slot = (
        next((b for b in slots if b.image == image), None) or next((b for b in slots if b.image is None), None) or slots.new()
    )
    slot.image = image
    slot.alpha = BACKGROUND_ALPHA
    _straighten(slot)
    slot.display_depth = "FRONT"
    slot.show_background_image = True
    data.show_background_images = True


def is_straight(data: bpy.types.Camera) -> bool:
    """Whether the camera shows its photo as it is, whole: a picture that is shifted, scaled, turned, flipped or cropped looks
    misplaced on a splat that it fits.
    """
    return all(_is_straight(slot) for slot in photo_slots(data))


def straighten(data: bpy.types.Camera) -> None:
    """Shows the camera's photo as it is."""
    for slot in photo_slots(data):
        if not _is_straight(slot):
            _straighten(slot)


def photo_slots(data: bpy.types.Camera) -> list[bpy.types.CameraBackgroundImage]:
    """The backgrounds of the camera that show its photo, a copy of it, or its plate."""
    shown = [image for image in (photo_of(data), data.gssmc.undistorted) if image]
    return [b for b in data.background_images if (b.source == "MOVIE_CLIP" and b.clip) or b.image in shown]


def _is_straight(slot: bpy.types.CameraBackgroundImage) -> bool:
    scale = round(slot.scale * slot.id_data.gssmc.overscan, SCALE_DIGITS)
    return (slot.frame_method, *slot.offset, scale, slot.rotation, slot.use_flip_x, slot.use_flip_y) == STRAIGHT


def _straighten(slot: bpy.types.CameraBackgroundImage) -> None:
    slot.frame_method, slot.offset, slot.scale, slot.rotation = STRAIGHT[0], STRAIGHT[1:3], STRAIGHT[3], STRAIGHT[4]
    slot.scale /= slot.id_data.gssmc.overscan  # A frame that shows more than the photo has it smaller in its middle.
    slot.use_flip_x = slot.use_flip_y = False


def show_instead(data: bpy.types.Camera, image: bpy.types.Image, photo: Photo) -> bpy.types.Image:
    """Shows `photo`'s pixels where `image` is the camera's background; a copy made before takes the new pixels' place."""
    name = f"{Path(image.name).stem} undistorted.png"
    slot = next((b for b in data.background_images if b.image and b.image in (image, data.gssmc.undistorted)), None)
    old, copy = data.gssmc.undistorted, packed_copy(name, photo)
    copy.display_aspect = image.display_aspect
    if slot is None:
        show_behind(data, copy)
    else:
        slot.image = copy
    data.gssmc.undistorted = copy
    if old is not None and old.users == 0:
        bpy.data.images.remove(old)
    return copy
