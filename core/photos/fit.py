"""A camera made to fit its photo: in its pixels upright, and at its size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..errors import PhotoError
from ..geometry.camera import Camera, Intrinsics, PixelOrder
from ..geometry.pinhole_cut import WideCamera
from ..geometry.turned_photo import TURNS, is_quarter_turn, upright_camera, upright_lens, upright_pose
from ..geometry.wide_lens import WideLens
from .photo import Photo, check_size, same_shape


def fit_camera(photo: Photo, camera: Camera) -> Camera:
    """The camera of the photo's upright pixels at its full size.

    Where EXIF turns the photo, the camera may belong to the pixels as they are stored. A quarter turn shows in the sizes; where
    they say nothing (a half turn, a square photo), `camera.pixel_order` decides. Raises PhotoError when the shapes contradict
    each other, the stored pixels are mirrored, or the photo has to be cut first (`fit_wide`).
    """
    if isinstance(camera, WideCamera):
        raise PhotoError(
            f"'{Path(photo.file).name or 'The photo'}' was taken through a lens {camera.lens.model}, which Blender has not; "
            "place it with the command 'refine' or 'batch', which cuts such a photo into pinhole pictures, or undistort it."
        )
    if is_of_stored_pixels(photo, camera.intrinsics, camera.pixel_order):
        camera = upright_camera(camera, photo.orientation)
    return replace(camera, intrinsics=check_size(photo, camera.intrinsics), pixel_order="upright")


def fit_wide(photo: Photo, lens: WideLens, pixel_order: PixelOrder = "upright") -> WideLens:
    """As `fit_lens`, of a lens that cuts are made of. Raises CameraError where it does not turn with the photo."""
    if is_of_stored_pixels(photo, lens.pinhole(), pixel_order):
        lens = lens.turned(photo.orientation)
    k = check_size(photo, lens.pinhole())
    return lens.resized(k.width, k.height)


def fit_wide_camera(photo: Photo, camera: WideCamera) -> WideCamera:
    """As `fit_camera`. Raises CameraError as `fit_wide`."""
    stored = is_of_stored_pixels(photo, camera.lens.pinhole(), camera.pixel_order)
    pose = upright_pose(camera.pose, photo.orientation) if stored else camera.pose
    return WideCamera.of(fit_wide(photo, camera.lens, camera.pixel_order), pose, camera.file)


def fit_lens(photo: Photo, lens: Intrinsics, pixel_order: PixelOrder = "upright") -> Intrinsics:
    """As `fit_camera`, of a lens alone."""
    if is_of_stored_pixels(photo, lens, pixel_order):
        lens = upright_lens(lens, photo.orientation)
    return check_size(photo, lens)


def is_of_stored_pixels(photo: Photo, lens: Intrinsics, pixel_order: PixelOrder) -> bool:
    """Whether the lens has to be turned with the photo. Raises PhotoError when it would have to be mirrored."""
    if photo.stored_upright:
        return False
    size = photo.width, photo.height
    stored = pixel_order == "stored"
    if is_quarter_turn(photo.orientation):
        fits_upright, fits_stored = (same_shape(one, (lens.width, lens.height)) for one in (size, size[::-1]))
        stored = fits_stored and (stored or not fits_upright)
    if stored and photo.orientation not in TURNS:
        raise PhotoError(
            f"'{Path(photo.file).name or 'The photo'}' is stored mirrored, as its EXIF data say, and its camera belongs to the "
            "stored pixels; save the photo as it is seen, and make its camera from that."
        )
    return stored
