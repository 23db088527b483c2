"""Keyframes of a camera, set through the bridge, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import bpy

from ...core.geometry.camera import Camera, Pose
from . import bridge as camera_bridge
from . import channels as camera_channels

TRANSFORM = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")


@dataclass(frozen=True)
class KeyOptions:
    """`lens`: whether focal length and shift are keyed; `filled`: the frames whose camera was not found by itself, but lies on
    the path of the others; their keys are of Blender's type Generated; `pinned`: those whose camera is the user's, of type
    Extreme.
    """

    lens: bool = False
    filled: frozenset[int] = frozenset()
    pinned: frozenset[int] = frozenset()

    def kind(self, frame: int) -> str:
        """Blender's word for the type of the keys at a frame."""
        return "EXTREME" if frame in self.pinned else "GENERATED" if frame in self.filled else "KEYFRAME"

    @classmethod
    def as_keyed(cls, camera: bpy.types.Object, lens: bool) -> KeyOptions:
        """Those that leave the types of the camera's present keys as they are."""
        types = camera_channels.key_types(camera)
        filled, pinned = (frozenset(f for f, kind in types.items() if kind == wanted) for wanted in ("GENERATED", "EXTREME"))
        return cls(lens, filled, pinned)


def write(
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    splat: bpy.types.Object,
    cameras: Mapping[int, Camera],
    keys: KeyOptions,
) -> None:
    """Keys location and rotation, and the lens if `keys` say so or it has keys already, which would hold another one; other
    keys between the first and the last of `cameras` go. The scene ends at the frame where it was.

    Raises CameraError, with nothing written and no key lost, when the camera cannot be written at one of the frames.
    """
    check(scene, camera, splat, {frame: found.pose for frame, found in cameras.items()})
    current, part, before = scene.frame_current, scene.frame_subframe, None
    rotation = camera_channels.rotation_path(camera)
    keys_lens = keys.lens or camera_channels.has_lens_keys(camera.data)
    paths = {camera: ["location", rotation], camera.data: list(camera_channels.LENS_PATHS) if keys_lens else []}
    for block, names in paths.items():
        _clear(block, names, min(cameras), max(cameras))
    try:
        for frame, found in sorted(cameras.items()):
            scene.frame_set(frame)  # A parent or the splat may be animated.
            camera_bridge.write_camera(scene, camera, splat, found)
            before = continue_turn(camera, before)
            for block, names in paths.items():
                for name in names:
                    block.keyframe_insert(name, frame=frame, keytype=keys.kind(frame))
    finally:
        scene.frame_set(current, subframe=part)


def check(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, poses: Mapping[int, Pose]) -> None:
    """Tries every pose at its frame, for constraints, parent and splat may be animated. Scene and camera end as they were.

    Raises CameraError at the first frame where something would undo, or forbid, the pose.
    """
    with put_back(scene, camera):
        for frame, pose in sorted(poses.items()):
            scene.frame_set(frame)
            camera_channels.check_writable(camera)
            camera_bridge.write_pose(scene, camera, splat, pose)


@contextmanager
def put_back(scene: bpy.types.Scene, camera: bpy.types.Object) -> Iterator[None]:
    """Other frames may be gone to inside of it; scene and camera end as they were, also where a pose has no key."""
    current, part = scene.frame_current, scene.frame_subframe
    kept = {name: tuple(getattr(camera, name)) for name in TRANSFORM}
    try:
        yield
    finally:
        scene.frame_set(current, subframe=part)
        for name, value in kept.items():  # This also restores what has no key, and what was moved after its key was set.
            setattr(camera, name, value)
        for layer in scene.view_layers:
            layer.update()


def continue_turn(camera: bpy.types.Object, before: object) -> object:
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
    for curve in camera_channels.curves(block):
        if curve.data_path in names:
            for point in reversed([p for p in curve.keyframe_points if first <= p.co.x <= last]):
                curve.keyframe_points.remove(point, fast=True)
            curve.update()
