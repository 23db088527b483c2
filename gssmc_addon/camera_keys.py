"""Keyframes of a camera: whether they can be set, and set through the bridge, frame by frame."""

from __future__ import annotations

import bpy

from ..core.camera import Camera
from ..core.errors import CameraError
from . import camera_bridge

ROTATION_PATHS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}
LENS_PATHS = ("lens", "shift_x", "shift_y")


def check_keyable(camera: bpy.types.Object) -> None:
    """Raises CameraError when keys would be forbidden, or not count: a library, a constraint, a driver."""
    if not (camera.is_editable and camera.data.is_editable):
        raise CameraError(f'The camera "{camera.name}" comes from a linked library; make it local first.')
    active = [c.name for c in camera.constraints if c.enabled and c.influence > 0]
    if active:
        raise CameraError(f'The constraint "{active[0]}" holds the camera "{camera.name}"; disable or apply it first.')
    for block in (camera, camera.data):
        paths = [driver.data_path for driver in block.animation_data.drivers] if block.animation_data else []
        driven = [path for path in paths if path.startswith(camera_bridge.WRITTEN_CHANNELS)]
        if driven:
            raise CameraError(f'The camera "{camera.name}" is driven ({driven[0]}); remove that driver first.')


def write(
    scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, cameras: dict[int, Camera], key_lens: bool
) -> None:
    """Keys location and rotation, and the lens if `key_lens`, at the frames of `cameras`; other keys between the first and the
    last of them go. The scene ends at the frame where it was.

    Raises CameraError, with nothing written, when the splat object can no longer carry a camera.
    """
    camera_bridge.splat_similarity(splat)
    current, before = scene.frame_current, None
    rotation = ROTATION_PATHS.get(camera.rotation_mode, "rotation_euler")
    paths = {camera: ["location", rotation], camera.data: list(LENS_PATHS) if key_lens else []}
    for block, names in paths.items():
        _clear(block, names, min(cameras), max(cameras))
    try:
        for frame, found in sorted(cameras.items()):
            scene.frame_set(frame)  # a parent or the splat may move
            camera_bridge.write_camera(scene, camera, splat, found)
            before = _continue_turn(camera, before)
            for block, names in paths.items():
                for name in names:
                    block.keyframe_insert(name, frame=frame)
    finally:
        scene.frame_set(current)


def _continue_turn(camera: bpy.types.Object, before: object) -> object:
    """Makes the rotation the closest to the key before it among those that mean the same: no spin between two keys."""
    if camera.rotation_mode == "QUATERNION":
        if before is not None and camera.rotation_quaternion.dot(before) < 0:
            camera.rotation_quaternion.negate()
        return camera.rotation_quaternion.copy()
    if camera.rotation_mode == "AXIS_ANGLE":
        return None
    if before is not None:
        camera.rotation_euler.make_compatible(before)
    return camera.rotation_euler.copy()


def _clear(block: bpy.types.ID, names: list[str], first: int, last: int) -> None:
    """Removes the keys of the channels from frame `first` to `last`."""
    for curve in _curves(block):
        if curve.data_path in names:
            for point in reversed([p for p in curve.keyframe_points if first <= p.co.x <= last]):
                curve.keyframe_points.remove(point, fast=True)
            curve.update()


def _curves(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    animation = block.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return []
    strips = [strip for layer in animation.action.layers for strip in layer.strips]
    bags = [strip.channelbag(animation.action_slot) for strip in strips]
    return [curve for bag in bags if bag for curve in bag.fcurves]
