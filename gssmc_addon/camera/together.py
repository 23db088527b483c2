"""A splat is moved, and the cameras of its photos with it.

A camera of a photo belongs to the splat: where it stands in the scan is what refining found. So it is moved along, and stays
where it is in the scan, while everything else of the scene stays where it is in the scene. What hangs below the splat, such as
its proxies, goes with it by itself.
"""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ...core.errors import SplatFormatError
from ..support.texts import rpt_
from . import bridge as camera_bridge
from . import channels as camera_channels
from . import keys as camera_keys

SAME_SCALE = 1e-6
MOVED = ("location", "rotation", "scale", "delta_")


def move(scene: bpy.types.Scene, splat: bpy.types.Object, motion: Matrix) -> int:
    """Moves the splat by `motion`, a rotation, translation and uniform scale of the scene, and the cameras of photos with it;
    how many these are. Their keys are moved too, and how near and how far they see grows with the scale.

    Raises SplatFormatError or CameraError, with nothing changed, when something else moves the splat or a camera.
    """
    _check_free(splat)
    cameras = [obj for obj in scene.objects if _belongs(scene, splat, obj)]
    for camera in cameras:
        camera_channels.check_writable(camera)
    splat.matrix_world = motion @ splat.matrix_world
    for camera in cameras:
        _move(scene, camera, motion)
    _scale_reach({camera.data for camera in cameras}, motion.median_scale)
    for layer in scene.view_layers:
        layer.update()
    return len(cameras)


def _scale_reach(lenses: set[bpy.types.Camera], factor: float) -> None:
    """Else a scan that became much larger would be cut off behind, and one that became much smaller in front."""
    if abs(factor - 1) > SAME_SCALE:
        for data in lenses:
            data.clip_start, data.clip_end = data.clip_start * factor, data.clip_end * factor


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


def _moved(camera: bpy.types.Object, motion: Matrix) -> Matrix:
    """The camera's matrix after the motion, its own scale as it is: a camera has no size. Blender evaluates no camera that is
    disabled in viewports or in an excluded collection, hence it is computed from its own channels where they tell it.
    """
    parent = camera.parent
    if parent is None or camera.parent_type == "OBJECT":
        world = camera_bridge.world_matrix(parent) @ camera.matrix_parent_inverse if parent else Matrix.Identity(4)
        now = world @ camera.matrix_basis
    else:
        now = camera.matrix_world
    place, turn, scale = now.decompose()
    return Matrix.LocRotScale(motion @ place, motion.to_quaternion() @ turn, scale)


def _move(scene: bpy.types.Scene, camera: bpy.types.Object, motion: Matrix) -> None:
    """Moves the camera, at each of its keys where it has some."""
    curves = [curve for curve in camera_channels.curves(camera) if curve.data_path.startswith(MOVED[:2])]
    frames = sorted({point.co.x for curve in curves for point in curve.keyframe_points})
    if not frames:
        camera.matrix_world = _moved(camera, motion)
        return
    current, subframe = scene.frame_current, scene.frame_subframe
    poses = []
    for frame in frames:  # All poses are read before any is written, because a new key changes the frames up to the next one.
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        for curve in curves:  # Of a camera that Blender does not evaluate, it does not move along either.
            getattr(camera, curve.data_path)[curve.array_index] = curve.evaluate(frame)
        poses.append(_moved(camera, motion))
    rotation, last = camera_channels.rotation_path(camera), None
    for frame, pose in zip(frames, poses, strict=True):
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        camera.matrix_world = pose
        last = camera_keys.continue_turn(camera, last)
        for path in ("location", rotation):
            camera.keyframe_insert(path, frame=frame)
    scene.frame_set(current, subframe=subframe)
