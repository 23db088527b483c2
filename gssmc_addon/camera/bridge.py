"""Blender camera <-> the engine's camera, in the coordinates of the splat file. Formulas: core.geometry.conventions."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import CameraError
from ...core.geometry import conventions
from ...core.geometry.camera import Camera, Intrinsics, Pose
from ...core.geometry.conventions import BlenderLens, Similarity
from ..support.texts import rpt_

DIST_NAMES = ("k1", "k2", "p1", "p2", "k3")
MATRIX_TOLERANCE = 1e-4  # float32 through a parent's inverse


@dataclass(frozen=True)
class CameraCopy:
    """A Blender camera copied out of Blender: `lens`, distortion (k1 k2 p1 p2 k3), pose in the splat file's coordinates.

    `frame`: render resolution (x, y) that the lens belongs to; the photo lies in its middle, as large as fits whole.
    """

    lens: BlenderLens
    dist: tuple[float, ...]
    pose: Pose
    frame: tuple[int, int]
    focal_guessed: bool = False

    def at_size(self, width: int, height: int) -> Camera:
        """The engine's camera for a photo of `width` x `height` pixels."""
        frame = conventions.intrinsics_from_blender(self.lens, *self.frame, self.dist)
        return Camera(conventions.photo_in_frame(frame, width, height), self.pose, focal_guessed=self.focal_guessed)


def splat_similarity(splat: bpy.types.Object) -> Similarity:
    """The splat object's transform. Raises CameraError when it is not rotation, translation and uniform scale."""
    return Similarity.from_matrix(np.array(splat.matrix_world))


def read_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object) -> CameraCopy:
    """Copies the camera. Raises CameraError when no pinhole camera of the splat's world can be made of it."""
    if camera.data.type != "PERSP":
        kind = camera.data.type.lower()
        raise CameraError(rpt_('The camera "{name}" is {kind}; set its type to Perspective.', name=camera.name, kind=kind))
    pose = conventions.pose_from_blender(np.array(camera.matrix_world), splat_similarity(splat))
    data = camera.data
    guessed = not data.gssmc.lens_calibrated
    return CameraCopy(read_lens(scene, data), read_distortion(data), pose, lens_frame(scene, data), guessed)


def lens_frame(scene: bpy.types.Scene, data: bpy.types.Camera) -> tuple[int, int]:
    """The render resolution for which the lens was set; the scene's own for a camera that was set by hand.

    Kept on the camera, because photos of another shape may have changed the resolution since. The percentage does not
    matter: it changes the size of a frame and not, up to a rounded pixel, its shape.
    """
    kept = data.gssmc.frame_x, data.gssmc.frame_y
    return kept if all(kept) else (scene.render.resolution_x, scene.render.resolution_y)


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


def write_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, result: Camera) -> bool:
    """Writes pose, lens, shift and distortion; world scale becomes 1. True when the scene's pixel aspect had to change too.

    Raises CameraError, with the camera as it was, when splat or parent can no longer carry it.
    """
    write_pose(scene, camera, splat, result.pose)
    return _write_lens_of(scene, camera, result)


def write_pose(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, pose: Pose) -> None:
    """Writes the pose alone, and sees that the camera took it; world scale becomes 1.

    Raises CameraError, with the camera as it was, when splat or parent cannot carry it.
    """
    matrix = _matrix_of(splat, pose)
    before = camera.matrix_basis.copy()
    camera.matrix_world = matrix
    for layer in scene.view_layers:
        layer.update()
    got = camera.matrix_world
    far = max(1.0, matrix.translation.length)
    turned = max(abs(got[i][j] - matrix[i][j]) for i in range(3) for j in range(3))
    if max(turned, (got.translation - matrix.translation).length / far) > MATRIX_TOLERANCE:
        camera.matrix_basis = before
        raise CameraError(
            rpt_(
                'The camera "{name}" cannot take its pose below its parent, which is scaled unevenly; '
                "clear the parent's scale or the parenting.",
                name=camera.name,
            )
        )


def write_new_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, result: Camera) -> None:
    """As `write_camera`, of a camera object without parent that is not yet in the scene: nothing else can move it, so no view
    layer has to be evaluated to see where it stands, which takes longer the more objects there are.
    """
    camera.matrix_world = _matrix_of(splat, result.pose)
    _write_lens_of(scene, camera, result)


def _matrix_of(splat: bpy.types.Object, pose: Pose) -> Matrix:
    return Matrix(conventions.pose_to_blender(pose, splat_similarity(splat)).tolist())


def _write_lens_of(scene: bpy.types.Scene, camera: bpy.types.Object, result: Camera) -> bool:
    camera.data.gssmc.lens_calibrated = not result.focal_guessed
    return write_intrinsics(scene, camera.data, result.intrinsics)


def write_intrinsics(scene: bpy.types.Scene, data: bpy.types.Camera, photo: Intrinsics) -> bool:
    """Writes the lens so that a photo with these intrinsics, fitted into the render's frame, lies where it should.

    True when the scene's pixel aspect had to change.
    """
    render = scene.render
    frame = conventions.frame_around_photo(photo, render.resolution_x, render.resolution_y)
    lens = conventions.blender_from_intrinsics(frame, read_lens(scene, data))
    data.gssmc.frame_x, data.gssmc.frame_y = render.resolution_x, render.resolution_y
    changed = _write_lens(scene, data, lens, photo.dist)
    for background in data.background_images:
        if background.image:  # else a photo in a frame of oblong pixels would be drawn with square ones
            background.image.display_aspect = lens.pixel_aspect_x, lens.pixel_aspect_y
    return changed


def move_to_render(scene: bpy.types.Scene, data: bpy.types.Camera, width: int, height: int) -> None:
    """Fits the lens to the render's present resolution; the camera of its `width` x `height` photo stays the same."""
    write_intrinsics(scene, data, photo_intrinsics(scene, data, width, height))


def photo_intrinsics(scene: bpy.types.Scene, data: bpy.types.Camera, width: int, height: int) -> Intrinsics:
    """The lens of the camera's `width` x `height` photo."""
    frame = conventions.intrinsics_from_blender(read_lens(scene, data), *lens_frame(scene, data), read_distortion(data))
    return conventions.photo_in_frame(frame, width, height)


def _write_lens(scene: bpy.types.Scene, data: bpy.types.Camera, lens: BlenderLens, dist: tuple[float, ...]) -> bool:
    """Writes lens (mm), shift and distortion; True when the scene's pixel aspect had to change."""
    data.lens, data.shift_x, data.shift_y = lens.lens_mm, lens.shift_x, lens.shift_y
    for name, value in zip(DIST_NAMES, dist, strict=True):
        setattr(data.gssmc, name, value)
    render = scene.render
    aspect_changes = (render.pixel_aspect_x, render.pixel_aspect_y) != (lens.pixel_aspect_x, lens.pixel_aspect_y)
    if aspect_changes:
        render.pixel_aspect_x, render.pixel_aspect_y = lens.pixel_aspect_x, lens.pixel_aspect_y
    return aspect_changes
