"""Another axis of a splat's file points up: the splat is turned, and the cameras of its photos with it.

A camera of a photo belongs to the splat: where it stands in the scan is what refining found. So it is moved along, and stays
where it is in the scan, while everything else of the scene stays where it is in the scene.
"""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ...core.errors import SplatFormatError
from ...core.geometry import conventions
from ...core.geometry.conventions import Orientation
from ..splat import up_axis
from ..support.texts import rpt_
from . import channels as camera_channels
from . import keys as camera_keys

MOVED = ("location", "rotation", "scale", "delta_")


def change(scene: bpy.types.Scene, splat: bpy.types.Object, axis: Orientation) -> int:
    """Turns the splat about its origin so that `axis` points up, and the cameras of photos with it; how many these are.

    What the user has done to the object besides is kept. Raises SplatFormatError or CameraError, with nothing changed, when
    something else moves the splat or a camera.
    """
    turn = conventions.orientation_matrix(up_axis.of(splat)).T @ conventions.orientation_matrix(axis)
    _check_free(splat)
    cameras = [obj for obj in scene.objects if _belongs(scene, splat, obj)]
    for camera in cameras:
        camera_channels.check_writable(camera)
    before = splat.matrix_world.copy()
    after = before @ Matrix(turn.tolist())
    motion = after @ before.inverted()
    splat.matrix_world = after
    splat.gssmc.up_axis = axis
    for camera in cameras:
        _move(scene, camera, motion)
    for layer in scene.view_layers:
        layer.update()
    return len(cameras)


def _check_free(splat: bpy.types.Object) -> None:
    animation = splat.animation_data
    driven = animation and any(driver.data_path.startswith(MOVED) for driver in animation.drivers)
    keyed = any(curve.data_path.startswith(MOVED) for curve in camera_channels.curves(splat))
    if not splat.is_editable or driven or keyed or any(c.enabled and c.influence > 0 for c in splat.constraints):
        raise SplatFormatError(
            rpt_(
                'The splat "{name}" is linked, animated or constrained, which would turn it back; clear that first.',
                name=splat.name,
            )
        )


def _belongs(scene: bpy.types.Scene, splat: bpy.types.Object, obj: bpy.types.Object) -> bool:
    """Whether it is the camera of a photo in this splat that does not follow the splat by itself."""
    if obj.type != "CAMERA" or splat != scene.gssmc.splat:
        return False
    parent = obj.parent
    while parent is not None:
        if parent == splat:
            return False
        parent = parent.parent
    return bool(obj.data.gssmc.photo or len(obj.data.background_images) or obj.data.gssmc.verdict != "NONE")


def _move(scene: bpy.types.Scene, camera: bpy.types.Object, motion: Matrix) -> None:
    """Moves the camera, at each of its keys where it has some."""
    curves = [curve for curve in camera_channels.curves(camera) if curve.data_path.startswith(MOVED[:2])]
    frames = sorted({point.co.x for curve in curves for point in curve.keyframe_points})
    if not frames:
        camera.matrix_world = motion @ camera.matrix_world
        return
    current, subframe = scene.frame_current, scene.frame_subframe
    poses = []
    for frame in frames:  # All poses are read before any is written, because a new key changes the frames up to the next one.
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        poses.append(motion @ camera.matrix_world)
    rotation, last = camera_channels.rotation_path(camera), None
    for frame, pose in zip(frames, poses, strict=True):
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        camera.matrix_world = pose
        last = camera_keys.continue_turn(camera, last)
        for path in ("location", rotation):
            camera.keyframe_insert(path, frame=frame)
    scene.frame_set(current, subframe=subframe)
