"""The only place where an axis is flipped, half a pixel is added, or a focal length in millimetres becomes pixels.

Frames (docs/design.md, section 2): the engine's cameras are OpenCV (x right, y down, z forward), poses world-to-camera;
Blender's, nerfstudio's and OpenGL's cameras look along -z with y up, given as camera-to-world. COLMAP's cameras are the
engine's own: no function needed.
"World" of the engine is the coordinates of the splat file; a Blender object's matrix (a similarity) takes them to the scene.
Pixels: the centre of the top-left pixel is (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..errors import CameraError
from .camera import FloatArray, Intrinsics, Pose

Distortion = tuple[float, float, float, float, float]
SensorFit = Literal["AUTO", "HORIZONTAL", "VERTICAL"]
Orientation = Literal["Y_DOWN", "Y_UP", "Z_UP", "Z_DOWN"]
ORIENTATIONS: tuple[Orientation, ...] = get_args(Orientation)

FLIP_YZ = np.diag([1.0, -1.0, -1.0])  # OpenCV camera axes <-> OpenGL/Blender camera axes; its own inverse
# The half turn about x that takes a world with y down to one with y up, and back: factors of x y z, of a Gaussian's quaternion
# w x y z (its ellipsoid is its own mirror image in its axes), and of SH coefficients 0..15, each the parity of its polynomial.
HALF_TURN_X = np.array([1.0, -1.0, -1.0])
HALF_TURN_X_QUATERNION = np.array([1.0, 1.0, -1.0, -1.0])
HALF_TURN_X_SH = np.array([1.0, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1])
NO_DISTORTION: Distortion = (0.0, 0.0, 0.0, 0.0, 0.0)
DIAGONAL_35MM = float(np.hypot(36.0, 24.0))
VIEW_SENSOR_MM = 72.0  # of Blender's 3D viewport: CAMERA_PARAM_ZOOM_INIT_PERSP = 2 times the camera's 36 mm
HALF_PIXEL = 0.5  # the engine puts the centre of the top-left pixel at (0.5, 0.5), OpenCV and pixel indices at (0, 0)
SIMILARITY_TOLERANCE = 1e-3  # Blender's matrices are float32, and users type scales by hand

# Rows: where the file's x, y, z axes go in a z-up scene. Proper rotations all, so that nothing is mirrored.
_UP_ROTATIONS: dict[Orientation, FloatArray] = {
    "Y_DOWN": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "Y_UP": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "Z_UP": np.eye(3),
    "Z_DOWN": np.diag([1.0, -1.0, -1.0]),
}


def from_opencv_pixels(pixels: ArrayLike) -> FloatArray:
    """Places (..., 2) that OpenCV, or an index into an image, gives, in the engine's pixels; float64."""
    return np.asarray(pixels, np.float64) + HALF_PIXEL


def to_opencv_pixels(pixels: FloatArray) -> FloatArray:
    """The engine's pixels (..., 2) as OpenCV counts them. Inverse of `from_opencv_pixels`."""
    return pixels - HALF_PIXEL


def opencv_matrix(intrinsics: Intrinsics) -> FloatArray:
    """K (3, 3) for OpenCV's pixels."""
    K = intrinsics.matrix
    K[:2, 2] -= HALF_PIXEL
    return K


def pixel_centres(count: int, first: int = 0) -> FloatArray:
    """Where the centres of `count` pixels of a row or a column lie (count,), from pixel number `first` on."""
    return np.arange(first, first + count, dtype=np.float64) + HALF_PIXEL


def orientation_matrix(orientation: Orientation) -> FloatArray:
    """4x4 rotation from a file whose named axis points up (or down) to Blender's z-up scene."""
    matrix = np.eye(4)
    matrix[:3, :3] = _UP_ROTATIONS[orientation]
    return matrix


@dataclass(frozen=True, eq=False)
class Similarity:
    """p_scene = scale * rotation @ p_file + translation; scale > 0, rotation (3, 3) proper, translation (3,)."""

    scale: float
    rotation: FloatArray
    translation: FloatArray

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Similarity:
        """Splits a 4x4 affine matrix. Raises CameraError when it is not rotation, translation and uniform scale."""
        m = np.asarray(matrix, np.float64)
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise CameraError("The splat object's matrix is not a finite 4x4 matrix; clear its transform and place it again.")
        linear = m[:3, :3]
        if np.linalg.norm(linear, axis=0).min() <= 0:
            raise CameraError("The splat object has a scale of zero; give it the same scale above zero in x, y and z.")
        if np.linalg.det(linear) < 0:
            raise CameraError("The splat object is mirrored (negative scale); make its scale positive in all axes.")
        u, s, vt = np.linalg.svd(linear)
        if s[2] < s[0] * (1 - SIMILARITY_TOLERANCE):
            sizes = ", ".join(f"{x:.4g}" for x in np.linalg.norm(linear, axis=0))
            raise CameraError(f"The splat object is scaled unevenly ({sizes}); give it the same scale in x, y and z.")
        return cls(float(np.cbrt(s.prod())), u @ vt, m[:3, 3].copy())

    def __eq__(self, other: object) -> bool:
        """Whether scale, rotation and translation are the same numbers."""
        return (
            isinstance(other, Similarity)
            and self.scale == other.scale
            and np.array_equal(self.rotation, other.rotation)
            and np.array_equal(self.translation, other.translation)
        )

    def __hash__(self) -> int:
        return hash((self.scale, (self.rotation + 0.0).tobytes(), (self.translation + 0.0).tobytes()))

    def to_scene(self, points: ArrayLike) -> FloatArray:
        """Points of the splat file (N, 3) to the scene."""
        return self.scale * np.asarray(points, np.float64) @ self.rotation.T + self.translation

    def to_file(self, points: ArrayLike) -> FloatArray:
        """Points of the scene (N, 3) to the splat file's coordinates."""
        return (np.asarray(points, np.float64) - self.translation) @ self.rotation / self.scale

    def inverse(self) -> Similarity:
        """From the scene to the file."""
        return Similarity(1 / self.scale, self.rotation.T, self.to_file(np.zeros(3)))

    def pose_to_scene(self, pose: Pose) -> Pose:
        """The world-to-camera pose, among the scene's points, of a camera that has `pose` among the file's."""
        return Pose.from_centre(pose.R @ self.rotation.T, self.to_scene(pose.centre))


def pose_from_blender(camera_to_scene: ArrayLike, splat: Similarity) -> Pose:
    """The engine's pose, in the splat file's coordinates, of a Blender camera with the 4x4 `matrix_world` given.

    Scale on the camera itself is ignored, as Blender's own renderers do. Raises CameraError when the matrix shears or mirrors.
    """
    m = np.asarray(camera_to_scene, np.float64)
    lengths = np.linalg.norm(m[:3, :3], axis=0)
    if not np.isfinite(m).all():
        raise CameraError("The camera's place is no finite number; clear its transform and its parent's, and place it again.")
    if lengths.min() <= 0:
        raise CameraError("The camera or its parent has a scale of zero; give both a scale above zero.")
    axes = m[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > SIMILARITY_TOLERANCE or np.linalg.det(axes) < 0:
        raise CameraError("The camera is sheared or mirrored by its parent; clear the parent's uneven or negative scale.")
    rotation = (splat.rotation.T @ axes @ FLIP_YZ).T
    return Pose.from_centre(rotation, splat.to_file(m[:3, 3]))


def pose_to_blender(pose: Pose, splat: Similarity) -> FloatArray:
    """The 4x4 `matrix_world` (scale 1) of a Blender camera at the engine's `pose`. Inverse of `pose_from_blender`."""
    matrix = np.eye(4)
    matrix[:3, :3] = splat.rotation @ pose.R.T @ FLIP_YZ
    matrix[:3, 3] = splat.to_scene(pose.centre)
    return matrix


def pose_from_opengl(camera_to_world: ArrayLike) -> Pose:
    """The engine's pose of an OpenGL (nerfstudio, NeRF) camera given as camera-to-world, 4x4 or its first three rows.

    Raises CameraError when the matrix is no finite rigid motion.
    """
    m = np.asarray(camera_to_world, np.float64)
    if m.shape not in ((3, 4), (4, 4)) or not np.isfinite(m).all():
        raise CameraError("The camera's matrix is not a finite 4x4 matrix; give the camera-to-world matrix.")
    return Pose.from_centre((m[:3, :3] @ FLIP_YZ).T, m[:3, 3])


def pose_to_opengl(pose: Pose) -> FloatArray:
    """The 4x4 camera-to-world matrix of an OpenGL camera at the engine's `pose`. Inverse of `pose_from_opengl`."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.R.T @ FLIP_YZ
    matrix[:3, 3] = pose.centre
    return matrix


@dataclass(frozen=True)
class BlenderLens:
    """What Blender's camera and render settings say of the projection, in Blender's own terms and units."""

    lens_mm: float
    sensor_width_mm: float = 36.0
    sensor_height_mm: float = 24.0
    sensor_fit: SensorFit = "AUTO"
    shift_x: float = 0.0
    shift_y: float = 0.0
    pixel_aspect_x: float = 1.0
    pixel_aspect_y: float = 1.0

    @property
    def pixel(self) -> float:
        """How wide a pixel is shown, in its heights."""
        return self.pixel_aspect_x / self.pixel_aspect_y

    def _sensor_and_size(self, width: int, height: int) -> tuple[float, float]:
        """Sensor length (mm) along the fitted axis, and the image's extent along it in square units (pixels x aspect)."""
        across, down = width * self.pixel_aspect_x, height * self.pixel_aspect_y
        if self.sensor_fit == "AUTO":  # Blender takes sensor_width for portrait too
            return self.sensor_width_mm, max(across, down)
        return (self.sensor_width_mm, across) if self.sensor_fit == "HORIZONTAL" else (self.sensor_height_mm, down)


def intrinsics_from_blender(lens: BlenderLens, width: int, height: int, dist: Distortion = NO_DISTORTION) -> Intrinsics:
    """Intrinsics, in pixels of a `width` x `height` image, of a Blender camera; `dist` as in `Intrinsics`."""
    sensor, size = lens._sensor_and_size(width, height)
    focal = lens.lens_mm / sensor * size
    return Intrinsics(
        width=width,
        height=height,
        fx=focal / lens.pixel_aspect_x,
        fy=focal / lens.pixel_aspect_y,
        cx=width / 2 - lens.shift_x * size / lens.pixel_aspect_x,
        cy=height / 2 + lens.shift_y * size / lens.pixel_aspect_y,
        dist=dist,
    )


def blender_from_intrinsics(intrinsics: Intrinsics, like: BlenderLens) -> BlenderLens:
    """Blender's lens, shifts and pixel aspect for `intrinsics`; sensor sizes and fit are those of `like`.

    The pixel aspect of `like` is kept where it fits fx : fy to float32 accuracy already, for it belongs to the whole scene.
    """
    fx, fy = intrinsics.fx, intrinsics.fy
    ax, ay = like.pixel_aspect_x, like.pixel_aspect_y
    if abs(fx * ax - fy * ay) > 1e-6 * fx * ax:  # Blender wants both aspects >= 1
        ax, ay = (1.0, fx / fy) if fx >= fy else (fy / fx, 1.0)
    shaped = replace(like, pixel_aspect_x=ax, pixel_aspect_y=ay)
    sensor, size = shaped._sensor_and_size(intrinsics.width, intrinsics.height)
    return replace(
        shaped,
        lens_mm=fx * ax * sensor / size,
        shift_x=(intrinsics.width / 2 - intrinsics.cx) * ax / size,
        shift_y=(intrinsics.cy - intrinsics.height / 2) * ay / size,
    )


def photo_in_frame(
    frame: Intrinsics, width: int, height: int, frame_pixel: float = 1.0, photo_pixel: float = 1.0
) -> Intrinsics:
    """The camera of a `width` x `height` photo that lies in the middle of the frame, as large as fits whole (Blender's "Fit").

    The frame is the camera of the whole render; where the shapes are the same, the photo fills it. `frame_pixel` and
    `photo_pixel`: how wide a pixel of each is shown, in its heights.
    """
    across, down = _photo_pixel_in_frame((width, height), (frame.width, frame.height), frame_pixel, photo_pixel)
    return _recentred(frame, (width, height), (1 / across, 1 / down))


def frame_around_photo(
    photo: Intrinsics, width: int, height: int, frame_pixel: float = 1.0, photo_pixel: float = 1.0
) -> Intrinsics:
    """The camera of a `width` x `height` render in which the photo lies as `photo_in_frame` says; its inverse."""
    size = photo.width, photo.height
    return _recentred(photo, (width, height), _photo_pixel_in_frame(size, (width, height), frame_pixel, photo_pixel))


def pixel_shape(intrinsics: Intrinsics) -> float:
    """Width over height of a pixel on a sensor whose one focal length is fx pixel widths, and fy pixel heights, long."""
    return intrinsics.fy / intrinsics.fx


def pixel_aspects(shape: float) -> tuple[float, float]:
    """A pixel's width over height as Blender has it: two numbers of which the smaller one is 1."""
    return (shape, 1.0) if shape >= 1 else (1.0, 1 / shape)


def _photo_pixel_in_frame(
    photo: tuple[int, int], frame: tuple[int, int], frame_pixel: float, photo_pixel: float
) -> tuple[float, float]:
    """How many pixels of the frame a photo's pixel is wide and high, with the photo as large as fits whole."""
    stretch = photo_pixel / frame_pixel
    scale = min(frame[0] / (photo[0] * stretch), frame[1] / photo[1])
    return scale * stretch, scale


def _recentred(k: Intrinsics, size: tuple[int, int], scale: tuple[float, float]) -> Intrinsics:
    (width, height), (across, down) = size, scale
    return replace(
        k,
        width=width,
        height=height,
        fx=k.fx * across,
        fy=k.fy * down,
        cx=(k.cx - k.width / 2) * across + width / 2,
        cy=(k.cy - k.height / 2) * down + height / 2,
    )


def focal_px_from_view(lens_mm: float, view: tuple[float, float], picture: tuple[float, float]) -> float:
    """Focal length in pixels with which a `picture` (width, height) shows what Blender's 3D viewport shows of it.

    `view`: the viewport's region in pixels; the picture lies in its middle, as large as fits whole. The viewport takes its
    lens (mm) for a sensor of VIEW_SENSOR_MM along its longer side, twice that of a camera: 50 mm there are 25 mm on film.
    """
    focal = lens_mm / VIEW_SENSOR_MM * max(view)
    return focal * max(picture[0] / view[0], picture[1] / view[1])


def focal_px_from_35mm(focal_35mm: float, width: float, height: float) -> float:
    """Focal length in pixels from EXIF's 35 mm equivalent (mm), which is defined over the image's diagonal (CIPA DCG-001)."""
    return focal_35mm * float(np.hypot(width, height)) / DIAGONAL_35MM
