"""The pictures of a preview as Blender images: photo, render and what is made of them, found again by a mark on each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.pictures.compare import Comparison, Image, decode_png, encode_png

MARK, KEY = "gssmc_preview", "gssmc_key"
NAMES = {"picture": "GS-SMC Preview", "photo": "GS-SMC Photo", "render": "GS-SMC Render"}


def find(kind: str) -> bpy.types.Image | None:
    """The image of a kind ("picture", "photo" or "render"), whatever the user called it since."""
    return next((image for image in bpy.data.images if image.get(MARK) == kind), None)


@dataclass(frozen=True)
class Key:
    """What a pair of photo and render belongs to: the view, and what the splat holds; `splat` "" is any."""

    view: str
    splat: str = ""

    def fits(self, kept: object) -> bool:
        """Whether a picture that was kept under `kept` is of this view, and of this content of the splat."""
        view, _, splat = str(kept).partition(" ")
        return view == self.view and self.splat in ("", splat)


def put(kind: str, png: bytes, size: tuple[int, int], key: str = "") -> bpy.types.Image:
    """Makes the PNG the image of its kind. Packed, for an image that is only painted would come back black from undo."""
    image = find(kind)
    if image is None:
        image = bpy.data.images.new(NAMES[kind], *size)
        image[MARK] = kind
        image.alpha_mode = "NONE"  # The alpha of the render only says where the scan has anything.
    image.pack(data=png, data_len=len(png))
    image.source = "FILE"
    image.buffers_free()
    image[KEY] = key
    return image


def put_pair(pair: Comparison, key: Key) -> None:
    """Keeps photo and render for other styles of the same view."""
    mark = f"{key.view} {key.splat}"
    size = (pair.photo.shape[1], pair.photo.shape[0])
    alpha = np.where(pair.solid, 255, 0).astype(np.uint8)[..., None]
    put("photo", encode_png(pair.photo), size, mark)
    put("render", encode_png(np.concatenate([pair.render, alpha], axis=2)), size, mark)


def packed_pair(key: Key) -> tuple[bytes, bytes] | None:
    """The kept photo and render of `key` as PNG, None when they belong to another."""
    photo, render = find("photo"), find("render")
    if photo is None or render is None:
        return None
    if any(not key.fits(image.get(KEY)) or not image.packed_file for image in (photo, render)):
        return None
    return bytes(photo.packed_file.data), bytes(render.packed_file.data)


def unpack_pair(packed: tuple[bytes, bytes]) -> Comparison | None:
    """The pair of `packed_pair`; needs no Blender. None when its pictures were replaced by others."""
    photo, render = (decode_png(data) for data in packed)
    if photo is None or render is None or render.shape[2] != 4 or photo.shape[:2] != render.shape[:2]:
        return None
    return Comparison(photo[..., :3], np.ascontiguousarray(render[..., :3]), render[..., 3] > 0)


def put_picture(picture: Image) -> bpy.types.Image:
    """Makes the picture (H, W, 3), 8-bit RGB, the image that the preview shows."""
    return put("picture", encode_png(picture), (picture.shape[1], picture.shape[0]))


def editors() -> Iterator[bpy.types.Area]:
    """Every open Image Editor, the UV Editor not among them."""
    for window in bpy.context.window_manager.windows:
        yield from (area for area in window.screen.areas if area.ui_type == "IMAGE_EDITOR")


def show(image: bpy.types.Image) -> bool:
    """Shows the image in the Image Editor that shows one of ours, else in the largest one. False when none is open."""
    areas = sorted(editors(), key=lambda area: area.width * area.height, reverse=True)
    if not areas:
        return False
    ours = [area for area in areas if is_ours(area.spaces.active.image)]
    area = (ours or areas)[0]
    area.spaces.active.image = image
    area.tag_redraw()
    return True


def is_ours(image: bpy.types.Image | None) -> bool:
    """Whether the image was made by a preview, under whatever name it has now."""
    return image is not None and MARK in image


def in_viewport() -> bpy.types.Camera | None:
    """The camera through which viewports show a preview."""
    return next((data for data in bpy.data.cameras for slot in data.background_images if is_ours(slot.image)), None)


def show_in_viewport(data: bpy.types.Camera | None, image: bpy.types.Image | None) -> None:
    """Makes `image` a picture before the scene for who looks through this camera, and through no other; None takes the preview
    away everywhere. The photo's own background stays.
    """
    for camera in bpy.data.cameras:  # There is only one picture, and another camera must not show it as its own.
        slots = [slot for slot in camera.background_images if is_ours(slot.image)]
        keep = 1 if image is not None and camera == data else 0
        for slot in slots[keep:]:
            camera.background_images.remove(slot)
        if len(slots) > keep:
            camera.update_tag()  # Removing a background image alone does not update the viewport's copy of the camera.
    if image is None or data is None:
        return
    slot = next((slot for slot in data.background_images if is_ours(slot.image)), None) or data.background_images.new()
    slot.image, slot.alpha, slot.frame_method, slot.display_depth = image, 1.0, "FIT", "FRONT"
    if data.gssmc.photo:
        image.display_aspect = data.gssmc.photo.display_aspect  # The preview's pixels have the photo's aspect.
    slot.show_background_image = data.show_background_images = True
    data.update_tag()
