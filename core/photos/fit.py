"""A camera made to fit its photo: in its pixels upright, and at its size."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import PhotoError
from ..geometry.camera import Camera, Intrinsics, PixelOrder
from ..geometry.pinhole_cut import WideCamera
from ..geometry.turned_photo import TURNS, is_quarter_turn, upright_camera, upright_lens, upright_pose
from ..geometry.wide_lens import WideLens
from .photo import Photo, check_size, same_shape

# What the lens of a photo that can be matched is like. Its focal length as a share of the photo's longer side: from a view of
# 157 degrees to one of half a degree. How far its principal point may be outside of the photo, as a share of that: cropped
# photos have theirs outside. And how exactly the middle half of the photo is undistorted and distorted again, in pixels.
FOCAL_SHARE = (0.1, 100.0)
OUTSIDE_SHARE = 1.0
FOLDED_PX = 1.0


def fit_camera(photo: Photo, camera: Camera) -> Camera:
    """The camera of the photo's upright pixels at its full size.

    Where EXIF turns the photo, the camera may belong to the pixels as they are stored. A quarter turn shows in the sizes; where
    they say nothing (a half turn, a square photo), `camera.pixel_order` decides. Raises PhotoError when the shapes contradict
    each other, the stored pixels are mirrored, no photo has such a lens, or the photo has to be cut first (`fit_wide`).
    """
    if isinstance(camera, WideCamera):
        raise PhotoError(
            f"'{Path(photo.file).name or 'The photo'}' was taken through a lens {camera.lens.model}, which has to be cut into "
            "pinhole pictures; place it with the command 'refine' or 'batch', or undistort it."
        )
    if is_of_stored_pixels(photo, camera.intrinsics, camera.pixel_order):
        camera = upright_camera(camera, photo.orientation)
    lens = check_lens(photo, check_size(photo, camera.intrinsics))
    return replace(camera, intrinsics=lens, pixel_order="upright")


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


def other_reading(photo: Photo, camera: Camera) -> Camera | None:
    """`fit_camera` as if the camera said the other of the two about its pixels; None where the photo is not turned, or its size
    shows which of them the camera belongs to.
    """
    order: PixelOrder = "upright" if camera.pixel_order == "stored" else "stored"
    if photo.stored_upright or photo.orientation not in TURNS:
        return None
    orders = (camera.pixel_order, order)
    read = {is_of_stored_pixels(photo, camera.intrinsics, one) for one in orders}
    return fit_camera(photo, replace(camera, pixel_order=order)) if len(read) == len(orders) else None


def fit_lens(photo: Photo, lens: Intrinsics, pixel_order: PixelOrder = "upright") -> Intrinsics:
    """As `fit_camera`, of a lens alone."""
    if is_of_stored_pixels(photo, lens, pixel_order):
        lens = upright_lens(lens, photo.orientation)
    return check_lens(photo, check_size(photo, lens))


def check_lens(photo: Photo, k: Intrinsics) -> Intrinsics:
    """`k`, the lens of the photo at its size. Raises PhotoError where no photo that can be matched has such a lens, for then a
    refinement would fail and blame the pose.
    """
    name, side = Path(photo.file).name or "the photo", max(k.width, k.height)
    if not FOCAL_SHARE[0] <= k.focal / side <= FOCAL_SHARE[1]:
        view = 2 * math.degrees(math.atan(side / 2 / k.focal))
        raise PhotoError(
            f"The focal length of '{name}' is {k.focal:.3g} pixels, a view of {view:.3g} degrees over its {side} pixels, which "
            "cannot be matched; give it in pixels of the photo, or leave it out to have it found."
        )
    margin = OUTSIDE_SHARE * side
    if not (-margin <= k.cx <= k.width + margin and -margin <= k.cy <= k.height + margin):
        raise PhotoError(
            f"The principal point of '{name}' is at ({k.cx:.0f}, {k.cy:.0f}) pixels, far outside of its "
            f"{k.width} x {k.height}; give it in pixels from the upper left corner, or leave the lens out to have it found."
        )
    across, down = np.meshgrid(np.linspace(k.width / 4, k.width * 3 / 4, 9), np.linspace(k.height / 4, k.height * 3 / 4, 9))
    pixels = np.stack([across.ravel(), down.ravel()], axis=1)
    n = k.normalise(pixels)
    off = k.project(np.column_stack([n, np.ones(len(n))])) - pixels
    if k.has_distortion and not np.nanmax(np.abs(off)) <= FOLDED_PX:
        raise PhotoError(
            f"The distortion of '{name}' ({', '.join(f'{d:.3g}' for d in k.dist)}) folds its picture; give k1 k2 p1 p2 k3 as "
            "OpenCV defines them, or leave the lens out to have it found."
        )
    return k


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
