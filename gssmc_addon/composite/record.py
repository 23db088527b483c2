"""Reads properties by their paths before they are touched, and writes them back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import bpy

from ..camera import channels as camera_channels
from ..photo import image as photo_image

# Of the scene. The view transform comes before the look, which is one of those that the transform offers.
SCENE_PATHS = (
    "render.resolution_x",
    "render.resolution_y",
    "render.resolution_percentage",
    "render.pixel_aspect_x",
    "render.pixel_aspect_y",
    "render.use_crop_to_border",
    "render.film_transparent",
    "render.dither_intensity",
    "render.use_compositing",
    "view_settings.view_transform",
    "view_settings.look",
    "view_settings.exposure",
    "view_settings.gamma",
    "view_settings.use_curve_mapping",
    "view_settings.use_white_balance",
)
OBJECT_PATHS = ("hide_render", "is_holdout", "is_shadow_catcher")
KEPT_ON_CAMERA = ("frame_x", "frame_y", "frame_pixel", "photo_pixel", "overscan")
CAMERA_PATHS = (*camera_channels.LENS_PATHS, *(f"gssmc.{name}" for name in KEPT_ON_CAMERA))


def values(block: bpy.types.ID, paths: Iterable[str]) -> dict[str, Any]:
    """The values of properties of a data-block, by path."""
    return {path: block.path_resolve(path) for path in paths}


def put(block: bpy.types.ID, wanted: Mapping[str, Any]) -> list[str]:
    """Writes the values. Returns the paths that do not take theirs, such as a look that this Blender does not know."""
    refused = []
    for path, value in wanted.items():
        owner, _, name = path.rpartition(".")
        try:
            setattr(block.path_resolve(owner) if owner else block, name, value)
        except (TypeError, AttributeError, ValueError):
            refused.append(path)
    return refused


def of_camera(data: bpy.types.Camera) -> str:
    """The lens of a camera, the keys of it, and where its backgrounds show the photo, as JSON."""
    slots = [[slot.scale, *slot.offset] for slot in data.background_images]
    return json.dumps({"values": values(data, CAMERA_PATHS), "keys": _lens_keys(data), "slots": slots})


def put_camera(data: bpy.types.Camera, kept: str) -> None:
    """Writes what `of_camera` read, of a camera that has as many keys and backgrounds as then."""
    known = json.loads(kept)
    put(data, known["values"])
    curves = [curve for curve in camera_channels.curves(data) if curve.data_path in camera_channels.LENS_PATHS]
    for curve, points in zip(curves, known["keys"], strict=True):
        for point, (at, left, right) in zip(curve.keyframe_points, points, strict=True):
            point.co.y, point.handle_left.y, point.handle_right.y = at, left, right
        curve.update()
    for slot, (scale, x, y) in zip(data.background_images, known["slots"], strict=True):
        slot.scale, slot.offset = scale, (x, y)


def zoom_out(data: bpy.types.Camera, ratio: float) -> None:
    """Makes the camera's frame show `ratio` times as much around its middle, with the photo as much smaller in it."""
    before = data.gssmc.overscan
    data.gssmc.overscan = before * ratio
    for path in camera_channels.LENS_PATHS:
        setattr(data, path, getattr(data, path) / ratio)
    camera_channels.scale_lens_keys(data, 1 / ratio)
    for slot in photo_image.photo_slots(data):
        slot.scale /= ratio
        slot.offset = slot.offset[0] / ratio, slot.offset[1] / ratio


def _lens_keys(data: bpy.types.Camera) -> list[list[list[float]]]:
    curves = [curve for curve in camera_channels.curves(data) if curve.data_path in camera_channels.LENS_PATHS]
    return [[[p.co.y, p.handle_left.y, p.handle_right.y] for p in curve.keyframe_points] for curve in curves]
