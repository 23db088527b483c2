"""Frames of a plate whose camera the user set and wants kept: tracking holds them exactly."""

from __future__ import annotations

import bpy

from ....core.errors import CameraError
from ....core.geometry.camera import Pose
from ...camera import bridge as camera_bridge
from ...camera import channels as camera_channels
from ...camera import keys as camera_keys
from ...support.texts import rpt_


def frames(data: bpy.types.Camera) -> list[int]:
    """The pinned frames of the scene, in order."""
    return sorted({int(word) for word in data.gssmc.pinned_frames.split() if word.lstrip("-").isdigit()})


def toggle(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Pins the camera as it stands at the shown frame, with a key of type Extreme, or lets that frame go. Whether it is pinned.

    Raises CameraError where no key can be set.
    """
    data, now = camera.data, scene.frame_current
    pinned = now not in (before := frames(data))
    if pinned:
        camera_channels.check_writable(camera)
    names = "location", camera_channels.rotation_path(camera)
    for name in names if pinned else ():
        camera.keyframe_insert(name, frame=now)
    for curve in (c for c in camera_channels.curves(camera) if c.data_path in names):
        for point in (p for p in curve.keyframe_points if round(p.co.x) == now):
            point.type = "EXTREME" if pinned else "KEYFRAME"
    after = {*before, now} if pinned else {f for f in before if f != now}
    data.gssmc.pinned_frames = " ".join(map(str, sorted(after)))
    return pinned


def poses(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, start: int, end: int) -> dict[int, Pose]:
    """World-to-camera in the coordinates of the splat's file, of the pinned frames from `start` to `end`.

    The scene ends at the frame where it was. Raises CameraError where a pinned frame lost its key.
    """
    wanted = [frame for frame in frames(camera.data) if start <= frame <= end]
    keyed = set(camera_channels.key_frames(camera))
    lost = next((frame for frame in wanted if frame not in keyed), None)
    if lost is not None:
        raise CameraError(rpt_("Frame {frame} is pinned and has no key; set one there, or unpin it.", frame=lost))
    if not wanted:
        return {}
    found = {}
    with camera_keys.put_back(scene, camera):
        for frame in wanted:
            scene.frame_set(frame)
            found[frame] = camera_bridge.read_camera(scene, camera, splat).pose
    return found
