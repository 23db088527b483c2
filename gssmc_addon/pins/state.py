"""Pins between Blender and the engine: read, kept, solved for, and the camera written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import bpy

from ...core.errors import CameraError, PhotoError, RefineError
from ...core.geometry.camera import Camera
from ...core.photos.photo import photo_facts
from ...core.pose.pins.pin import Pin
from ...core.pose.pins.place import LEAST, PinOptions, place_by_pins
from ...core.pose.pins.report import PinReport
from ..camera import bridge as camera_bridge
from ..camera import channels as camera_channels
from ..camera import solution as camera_solution
from ..camera.record import SolvedCamera
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..support.texts import rpt_
from .props import EVERY

PINNED = "pinned"  # the verdict of a camera that pins alone place


def numbers(scene: bpy.types.Scene, data: bpy.types.Camera) -> list[int]:
    """Which of the camera's pins lie in the photo that the scene shows: all of a still, of a plate those of this frame."""
    image, pins = photo_image.photo_of(data), data.gssmc.pins
    clip = any(slot.source == "MOVIE_CLIP" and slot.clip for slot in data.background_images)
    if not (image.source in plate_source.MOVING if image else clip):
        return list(range(len(pins)))
    return [number for number, pin in enumerate(pins) if pin.frame in (EVERY, scene.frame_current)]


def of(scene: bpy.types.Scene, data: bpy.types.Camera) -> list[Pin]:
    """The camera's pins in the photo that the scene shows, in the coordinates of the splat's object."""
    kept = (data.gssmc.pins[number] for number in numbers(scene, data))
    return [Pin((p.photo[0], p.photo[1]), (p.world[0], p.world[1], p.world[2]), p.weight) for p in kept]


def put(scene: bpy.types.Scene, data: bpy.types.Camera, pins: Sequence[Pin]) -> None:
    """Makes these the pins of the photo that the scene shows; what was measured of the earlier ones is forgotten."""
    for number in reversed(numbers(scene, data)):
        data.gssmc.pins.remove(number)
    for pin in pins:
        add(scene, data, pin)


def add(scene: bpy.types.Scene, data: bpy.types.Camera, pin: Pin) -> int:
    """A further pin; its number, from 0."""
    one = data.gssmc.pins.add()
    one.photo, one.world, one.weight, one.frame = pin.photo, pin.world, pin.weight, scene.frame_current
    return len(data.gssmc.pins) - 1


def held(scene: bpy.types.Scene, data: bpy.types.Camera) -> tuple[Pin, ...]:
    """The pins that a refinement is to hold: none unless that was asked for."""
    return tuple(of(scene, data)) if scene.gssmc.hold_pins else ()


def size_of(data: bpy.types.Camera) -> tuple[int, int]:
    """Width and height of the photo whose pixels the pins count. Raises RefineError when there is no photo."""
    size = photo_image.own_size(data)
    if not all(size):
        raise RefineError(rpt_("The camera has no photo to pin; use Add Photo in the GS-SMC panel."))
    return size


def camera_of(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object) -> Camera:
    """The engine's camera of the photo at its own size. Raises CameraError, RefineError."""
    return camera_bridge.read_camera(scene, camera, splat).at_size(*size_of(camera.data))


def focal_35mm(data: bpy.types.Camera) -> float | None:
    """What the photo's EXIF says of its focal length; None where it says nothing, or is not to be had."""
    image = photo_image.photo_of(data)
    if image is None or image.source != "FILE":
        return None
    try:
        return photo_facts(photo_image.photo_file(image)).focal_35mm
    except (PhotoError, OSError):
        return None


def solve(scene: bpy.types.Scene, start: Camera, data: bpy.types.Camera, options: PinOptions) -> PinReport:
    """Where the camera's pins place it, near `start`. Raises RefineError, CameraError."""
    return place_by_pins(start, of(scene, data), options)


def show(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, report: PinReport) -> None:
    """Moves the camera to where the pins place it, and notes their errors; says nothing of it yet. Raises CameraError."""
    camera_bridge.write_camera(scene, camera, splat, report.camera)
    for number, error in zip(numbers(scene, camera.data), report.errors_px, strict=True):
        camera.data.gssmc.pins[number].error_px = error if math.isfinite(error) else -1.0


def keep(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, report: PinReport) -> str:
    """Keeps the camera that pins placed as its solution, with keys where it is animated. A sentence on keys, or ""."""
    keyed = camera_channels.write_keyframes(scene, camera)
    if len(report.pins) >= LEAST:
        state = "SOLVED" if report.solved_focal else camera.data.gssmc.lens_state
        solution = SolvedCamera(report.camera, PINNED, report.reasons, 0, report.seconds, state, report.median_depth)
        camera_solution.keep(scene, camera, splat, solution)
    return keyed


def check(scene: bpy.types.Scene) -> bpy.types.Object:
    """The scene's camera, which may be written and has a photo. Raises CameraError, RefineError."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise CameraError(rpt_("The scene has no camera for the photo; use Add Photo in the GS-SMC panel."))
    size_of(camera.data)
    camera_channels.check_writable(camera)
    return camera


def errors_now(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object) -> list[tuple[Any, Any]]:
    """Of each pin the pixel of the photo, and the one at which the camera sees its point now, None behind it. Raises
    CameraError, RefineError.
    """
    now, pins = camera_of(scene, camera, splat), of(scene, camera.data)
    if not pins:
        return []
    seen = now.intrinsics.project(now.pose.transform([pin.world for pin in pins]))
    return [
        (pin.photo, tuple(at) if all(map(math.isfinite, at)) else None) for pin, at in zip(pins, seen.tolist(), strict=True)
    ]
