"""Blender camera <-> the engine's camera, in the coordinates of the splat file. Formulas: core.geometry.conventions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix

from ...core.errors import CameraError
from ...core.geometry import conventions
from ...core.geometry.camera import Camera, Intrinsics, Pose
from ...core.geometry.conventions import BlenderLens, Similarity
from ..photo import image as photo_image
from ..support.texts import rpt_

CALIBRATED = "CALIBRATED"  # of the property `lens_state`
Distortion = tuple[float, float, float, float, float]  # in the order of DIST_NAMES
DIST_NAMES = ("k1", "k2", "p1", "p2", "k3")
MATRIX_TOLERANCE = 1e-4  # Blender multiplies with a parent's inverse in float32.
SAME_PIXEL = 1e-6  # A relative difference; Blender stores these values as float32.


@dataclass(frozen=True)
class CameraCopy:
    """A Blender camera copied out of Blender: `lens`, distortion (k1 k2 p1 p2 k3), pose in the splat file's coordinates.

    `frame`: render resolution (x, y) that the lens belongs to; the photo lies in its middle, as large as fits whole.
    `photo_pixel`: how wide a pixel of the photo is shown, in its heights; those of the frame stand in `lens`. `solved`: the
    lens that was solved since, in pixels of the photo at some size, which goes before all of these; None where none was.
    """

    lens: BlenderLens
    dist: Distortion
    pose: Pose
    frame: tuple[int, int]
    focal_guessed: bool = False
    photo_pixel: float = 1.0
    solved: Intrinsics | None = None

    def at_size(self, width: int, height: int) -> Camera:
        """The engine's camera for a photo of `width` x `height` pixels."""
        if self.solved is not None:
            return Camera(self.solved.resized(width, height), self.pose)
        frame = conventions.intrinsics_from_blender(self.lens, *self.frame, self.dist)
        photo = conventions.photo_in_frame(frame, width, height, self.lens.pixel, self.photo_pixel)
        return Camera(photo, self.pose, focal_guessed=self.focal_guessed)


def splat_similarity(splat: bpy.types.Object) -> Similarity:
    """The splat object's transform. Raises CameraError when it is not rotation, translation and uniform scale."""
    return Similarity.from_matrix(np.array(world_matrix(splat)))


def world_matrix(obj: bpy.types.Object) -> Matrix:
    """The object's matrix in the scene. Blender computes it only for objects in a view layer: after a file is opened, an object
    in an excluded collection still has the identity.
    """
    if obj.matrix_world != Matrix.Identity(4):
        return obj.matrix_world
    own = obj.matrix_basis
    return world_matrix(obj.parent) @ obj.matrix_parent_inverse @ own if obj.parent else own


def read_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object) -> CameraCopy:
    """Copies the camera. Raises CameraError when no pinhole camera of the splat's world can be made of it."""
    check_perspective(camera)
    pose = conventions.pose_from_blender(np.array(world_matrix(camera)), splat_similarity(splat))
    data, lens = camera.data, read_lens(scene, camera.data)
    guessed = data.gssmc.lens_state != CALIBRATED
    return CameraCopy(lens, read_distortion(data), pose, lens_frame(scene, data), guessed, photo_pixel(data, lens))


def check_perspective(camera: bpy.types.Object) -> None:
    """Raises CameraError when it is a camera of another type, such as an orthographic one."""
    if camera.data.type != "PERSP":
        kind = camera.data.type.lower()
        raise CameraError(rpt_('The camera "{name}" is {kind}; set its type to Perspective.', name=camera.name, kind=kind))


def lens_frame(scene: bpy.types.Scene, data: bpy.types.Camera) -> tuple[int, int]:
    """The render resolution for which the lens was set; the scene's own for a camera that was set by hand.

    Kept on the camera, because the resolution may have changed since. The percentage does not matter: it changes the size of a
    frame and not, up to a rounded pixel, its shape.
    """
    kept = data.gssmc.frame_x, data.gssmc.frame_y
    return kept if all(kept) else (scene.render.resolution_x, scene.render.resolution_y)


def read_lens(scene: bpy.types.Scene, data: bpy.types.Camera) -> BlenderLens:
    """Lens, sensor and shift of the camera, with the pixel aspect of the frame that they were set for (see `lens_frame`).

    While the frame shows more than the photo (`overscan`), they are those of the frame that the photo fills.
    """
    wide = data.gssmc.overscan
    shift = data.shift_x * wide, data.shift_y * wide
    lens = BlenderLens(data.lens * wide, data.sensor_width, data.sensor_height, data.sensor_fit, *shift)
    kept = data.gssmc.frame_pixel
    return with_aspects(lens, conventions.pixel_aspects(kept) if kept else render_aspects(scene))


def render_aspects(scene: bpy.types.Scene) -> tuple[float, float]:
    """The pixel aspect of the scene's render, x and y; Blender keeps both at 1 or above."""
    return scene.render.pixel_aspect_x, scene.render.pixel_aspect_y


def with_aspects(lens: BlenderLens, aspects: tuple[float, float]) -> BlenderLens:
    """The lens with the pixel aspect (x, y) of another render."""
    return replace(lens, pixel_aspect_x=aspects[0], pixel_aspect_y=aspects[1])


def photo_pixel(data: bpy.types.Camera, lens: BlenderLens) -> float:
    """Width over height of the photo's pixels as they are shown; that of the render's pixels until a lens sets it."""
    return data.gssmc.photo_pixel or lens.pixel


def read_distortion(data: bpy.types.Camera) -> Distortion:
    """The coefficients k1, k2, p1, p2, k3 (OpenCV's model, no unit) that the camera keeps; Blender itself knows none."""
    k1, k2, p1, p2, k3 = (getattr(data.gssmc, name) for name in DIST_NAMES)
    return k1, k2, p1, p2, k3


def write_camera(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, result: Camera) -> None:
    """Writes pose, lens, shift and distortion; world scale becomes 1.

    Raises CameraError, with the camera as it was, when splat or parent can no longer carry it.
    """
    write_pose(scene, camera, splat, result.pose)
    write_intrinsics(scene, camera.data, result.intrinsics)


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
    write_intrinsics(scene, camera.data, result.intrinsics)


def _matrix_of(splat: bpy.types.Object, pose: Pose) -> Matrix:
    return Matrix(conventions.pose_to_blender(pose, splat_similarity(splat)).tolist())


def write_intrinsics(scene: bpy.types.Scene, data: bpy.types.Camera, photo: Intrinsics) -> None:
    """Writes the lens so that a photo with these intrinsics, fitted into the render's frame, lies where it should.

    Where fx and fy differ, the photo's pixels are shown oblong; those of the render are the scene's and stay as they are.
    """
    props, render = data.gssmc, scene.render
    pixel = _nearly(float(np.float32(conventions.pixel_shape(photo))), props.photo_pixel)
    lens = lens_in_render(scene, data, photo, pixel)
    props.frame_x, props.frame_y, props.frame_pixel = render.resolution_x, render.resolution_y, lens.pixel
    props.photo_pixel = pixel
    _keep_size(data, photo)
    data.lens, data.shift_x, data.shift_y = (value / props.overscan for value in (lens.lens_mm, lens.shift_x, lens.shift_y))
    for name, value in zip(DIST_NAMES, photo.dist, strict=True):
        setattr(props, name, value)
    show_pixel(data)


def lens_in_render(scene: bpy.types.Scene, data: bpy.types.Camera, photo: Intrinsics, pixel: float) -> BlenderLens:
    """The lens with which the photo, its pixels `pixel` times as wide as high, lies in the render's present frame."""
    like = with_aspects(read_lens(scene, data), render_aspects(scene))
    # It has to be equal to the last digit, or Blender's pixel aspect would change.
    same_focal = replace(photo, fy=photo.fx * pixel)
    resolution = scene.render.resolution_x, scene.render.resolution_y
    frame = conventions.frame_around_photo(same_focal, *resolution, like.pixel, pixel)
    return conventions.blender_from_intrinsics(frame, like)


def show_pixel(data: bpy.types.Camera) -> None:
    """Makes Blender draw the pictures behind the camera with the pixel aspect of the photo."""
    if not data.gssmc.photo_pixel:
        return
    aspects = conventions.pixel_aspects(data.gssmc.photo_pixel)
    for background in data.background_images:
        image = background.image
        if image and max(abs(image.display_aspect[i] - aspects[i]) for i in (0, 1)) > SAME_PIXEL:
            image.display_aspect = aspects


def move_to_render(scene: bpy.types.Scene, data: bpy.types.Camera, width: int, height: int) -> None:
    """Fits the lens to the render's present resolution; the camera of its `width` x `height` photo stays the same."""
    write_intrinsics(scene, data, photo_intrinsics(scene, data, width, height))


def photo_intrinsics(scene: bpy.types.Scene, data: bpy.types.Camera, width: int, height: int) -> Intrinsics:
    """The lens of the camera's `width` x `height` photo."""
    lens = read_lens(scene, data)
    frame = conventions.intrinsics_from_blender(lens, *lens_frame(scene, data), read_distortion(data))
    return conventions.photo_in_frame(frame, width, height, lens.pixel, photo_pixel(data, lens))


def _keep_size(data: bpy.types.Camera, photo: Intrinsics) -> None:
    """Notes how large the photo is in its own file, of which Blender may hold a smaller copy that was refined."""
    props, image = data.gssmc, photo_image.photo_of(data)
    if props.framed != image or not (props.photo_x and props.photo_y):
        props.framed, props.photo_x, props.photo_y = image, photo.width, photo.height


def _nearly(value: float, kept: float) -> float:
    """`kept` where it equals `value` within float32, so that the value does not drift with every write."""
    return kept if kept and abs(value - kept) <= SAME_PIXEL * kept else value
