"""Blender camera <-> the engine's camera, in the coordinates of the splat file. The formulas live in core.conventions."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ..core import conventions
from ..core.camera import Camera, Pose
from ..core.conventions import BlenderLens, Similarity
from ..core.errors import CameraError

DIST_NAMES = ("k1", "k2", "p1", "p2", "k3")
WRITTEN_CHANNELS = ("location", "rotation", "lens", "shift")


@dataclass(frozen=True)
class CameraCopy:
    """A Blender camera copied out of Blender: `lens`, distortion (k1 k2 p1 p2 k3), pose in the splat file's coordinates."""

    lens: BlenderLens
    dist: tuple[float, ...]
    pose: Pose

    def at_size(self, width: int, height: int) -> Camera:
        """The engine's camera for a photo of `width` x `height` pixels."""
        return Camera(conventions.intrinsics_from_blender(self.lens, width, height, self.dist), self.pose)


def splat_similarity(splat: bpy.types.Object) -> Similarity:
    """The splat object's transform. Raises CameraError when it is not rotation, translation and uniform scale."""
    return Similarity.from_matrix(np.array(splat.matrix_world))


def read_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object) -> CameraCopy:
    """Copies the camera. Raises CameraError when no pinhole camera of the splat's world can be made of it."""
    if camera.data.type != "PERSP":
        raise CameraError(f'The camera "{camera.name}" is {camera.data.type.lower()}; set its type to Perspective.')
    pose = conventions.pose_from_blender(np.array(camera.matrix_world), splat_similarity(splat))
    return CameraCopy(read_lens(scene, camera.data), read_distortion(camera.data), pose)


def read_lens(scene: bpy.types.Scene, data: bpy.types.Camera) -> BlenderLens:
    """Lens, sensor and shift of the camera, with the scene's pixel aspect."""
    return BlenderLens(
        data.lens,
        data.sensor_width,
        data.sensor_height,
        data.sensor_fit,
        data.shift_x,
        data.shift_y,
        scene.render.pixel_aspect_x,
        scene.render.pixel_aspect_y,
    )


def read_distortion(data: bpy.types.Camera) -> tuple[float, ...]:
    return tuple(getattr(data.gssmc, name) for name in DIST_NAMES)


def check_writable(camera: bpy.types.Object) -> None:
    """Raises CameraError when something would undo, or forbid, a new pose: a constraint, a driver, animation, a library."""
    if not (camera.is_editable and camera.data.is_editable):
        raise CameraError(f'The camera "{camera.name}" comes from a linked library; make it local first.')
    active = [c.name for c in camera.constraints if c.enabled and c.influence > 0]
    if active:
        raise CameraError(f'The constraint "{active[0]}" holds the camera "{camera.name}"; disable or apply it first.')
    for block in (camera, camera.data):
        channel = _driven_channel(block)
        if channel:
            raise CameraError(f'The camera "{camera.name}" is animated or driven ({channel}); remove that animation first.')


def _driven_channel(block: bpy.types.ID) -> str | None:
    animation = block.animation_data
    if animation is None:
        return None
    paths = [d.data_path for d in animation.drivers]
    if animation.action and animation.action_slot:
        paths += [c.data_path for c in _slot_curves(animation)]
    return next((p for p in paths if p.startswith(WRITTEN_CHANNELS)), None)


def _slot_curves(animation: bpy.types.AnimData) -> list[bpy.types.FCurve]:
    strips = [strip for layer in animation.action.layers for strip in layer.strips]
    bags = [strip.channelbag(animation.action_slot) for strip in strips]
    return [curve for bag in bags if bag for curve in bag.fcurves]


def write_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, result: Camera) -> bool:
    """Writes pose, lens, shift and distortion; world scale becomes 1. True when the scene's pixel aspect had to change too.

    Raises CameraError, before anything is written, when the splat object can no longer carry the camera.
    """
    matrix = conventions.pose_to_blender(result.pose, splat_similarity(splat))
    lens = conventions.blender_from_intrinsics(result.intrinsics, read_lens(scene, camera.data))
    camera.matrix_world = Matrix(matrix.tolist())
    return write_lens(scene, camera.data, lens, result.intrinsics.dist)


def write_lens(scene: bpy.types.Scene, data: bpy.types.Camera, lens: BlenderLens, dist: tuple[float, ...]) -> bool:
    """Writes lens (mm), shift and distortion; True when the scene's pixel aspect had to change."""
    data.lens, data.shift_x, data.shift_y = lens.lens_mm, lens.shift_x, lens.shift_y
    for name, value in zip(DIST_NAMES, dist, strict=True):
        setattr(data.gssmc, name, value)
    render = scene.render
    aspect_changes = (render.pixel_aspect_x, render.pixel_aspect_y) != (lens.pixel_aspect_x, lens.pixel_aspect_y)
    if aspect_changes:
        render.pixel_aspect_x, render.pixel_aspect_y = lens.pixel_aspect_x, lens.pixel_aspect_y
    return aspect_changes
