"""Cameras: intrinsics with lens distortion, world-to-camera poses, and the errors between poses.

Frames (docs/design.md, section 2): OpenCV camera axes (x right, y down, z forward), pixel centres at +0.5, so the centre of
the top-left pixel is (0.5, 0.5). A pose is world-to-camera: x_c = R x_w + t.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import CameraError

FloatArray = NDArray[np.float64]

# Whether a camera belongs to a photo's pixels upright, as EXIF turns them, or as the file stores them.
PixelOrder = Literal["upright", "stored"]

UNDISTORT_ITERATIONS = 20
UNDISTORT_EPS = 1e-13
MIN_DETERMINANT = 1e-9  # below this the lens model folds over; such a pixel keeps its last estimate


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole with OpenCV distortion. Lengths in pixels of an image of `width` x `height`.

    `dist` holds (k1, k2, p1, p2, k3); shorter input is padded with zeros.
    Raises CameraError when a size or a focal length makes no camera.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    dist: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.dist)
        if not np.all(np.isfinite(numbers)):
            raise CameraError("The camera's intrinsics hold a value that is not finite; give finite fx, fy, cx, cy and dist.")
        if self.width < 1 or self.height < 1:
            raise CameraError(f"The camera's image is {self.width} x {self.height} pixels; both sides must be at least 1.")
        if self.fx <= 0 or self.fy <= 0:
            raise CameraError(f"The focal lengths are fx={self.fx:g}, fy={self.fy:g} pixels; both must be positive.")
        if len(self.dist) > 5:
            raise CameraError(f"The camera has {len(self.dist)} distortion values; k1 k2 p1 p2 and at most k3 are supported.")
        object.__setattr__(self, "dist", tuple(float(d) for d in self.dist) + (0.0,) * (5 - len(self.dist)))

    @property
    def matrix(self) -> FloatArray:
        """K, shape (3, 3), for pixel centres at +0.5."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def has_distortion(self) -> bool:
        return any(self.dist)

    @property
    def focal(self) -> float:
        """Geometric mean of fx and fy, pixels."""
        return float(np.sqrt(self.fx * self.fy))

    def pinhole(self) -> Intrinsics:
        """The same camera without lens distortion."""
        return replace(self, dist=(0.0,) * 5)

    def resized(self, width: int, height: int) -> Intrinsics:
        """The camera of the same image resampled to `width` x `height`."""
        sx, sy = width / self.width, height / self.height
        return replace(self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy)

    def with_long_side(self, long_side: int) -> Intrinsics:
        """The camera of the image scaled down to a long side of `long_side`; unchanged when it is no longer."""
        now = max(self.width, self.height)
        if now <= long_side:
            return self
        scale = long_side / now
        return self.resized(max(1, round(self.width * scale)), max(1, round(self.height * scale)))

    def project(self, points: ArrayLike) -> FloatArray:
        """Camera-space points (N, 3) to distorted pixels (N, 2). Points at z <= 0 give NaN."""
        p = np.asarray(points, np.float64).reshape(-1, 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            n = np.where(p[:, 2:] > 0, p[:, :2] / p[:, 2:], np.nan)
        d = self.distort_normalised(n)
        return np.stack([self.fx * d[:, 0] + self.cx, self.fy * d[:, 1] + self.cy], axis=1)

    def distort_normalised(self, n: FloatArray) -> FloatArray:
        """Ideal image-plane coordinates x/z, y/z (N, 2) to those the lens produces (OpenCV's model)."""
        if not self.has_distortion:
            return n
        k1, k2, p1, p2, k3 = self.dist
        x, y = n[:, 0], n[:, 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack(
            [x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=1
        )

    def normalise(self, pixels: ArrayLike) -> FloatArray:
        """Distorted pixels (N, 2) to ideal image-plane coordinates x/z, y/z (N, 2).

        Newton's method on the lens model: OpenCV's fixed-point iteration stops at an accuracy that differs by version.
        """
        px = np.asarray(pixels, np.float64).reshape(-1, 2)
        target = (px - (self.cx, self.cy)) / (self.fx, self.fy)
        if len(px) == 0 or not self.has_distortion:
            return target
        n = target.copy()
        for _ in range(UNDISTORT_ITERATIONS):
            residual = self.distort_normalised(n) - target
            a, b, d = self.distortion_jacobian(n)
            det = a * d - b * b
            step = np.stack([d * residual[:, 0] - b * residual[:, 1], a * residual[:, 1] - b * residual[:, 0]], axis=1)
            n = n - step / np.where(np.abs(det) > MIN_DETERMINANT, det, np.inf)[:, None]
            if np.abs(residual).max() < UNDISTORT_EPS:
                break
        return n

    def distortion_jacobian(self, n: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivative of `distort_normalised`: the entries xx, xy (= yx) and yy, each (N,)."""
        k1, k2, p1, p2, k3 = self.dist
        x, y = n[:, 0], n[:, 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + 3 * k3 * r2))
        return (
            radial + slope * x * x + 2 * p1 * y + 6 * p2 * x,
            slope * x * y + 2 * p1 * x + 2 * p2 * y,
            radial + slope * y * y + 6 * p1 * y + 2 * p2 * x,
        )

    def undistort(self, pixels: ArrayLike) -> FloatArray:
        """Distorted pixels (N, 2) to the pixels of `self.pinhole()` (N, 2)."""
        return self.to_pixels(self.normalise(pixels))

    def to_pixels(self, n: FloatArray) -> FloatArray:
        """Ideal image-plane coordinates x/z, y/z (N, 2) to the pixels of `self.pinhole()` (N, 2)."""
        return n * (self.fx, self.fy) + (self.cx, self.cy)


@dataclass(frozen=True, eq=False)
class Pose:
    """World-to-camera SE(3): x_c = R x_w + t. R (3, 3) and t (3,) are float64 in scene units.

    Raises CameraError when R is not a rotation (singular values within 1e-3 of 1) or a value is not finite. A rotation that
    passes is made orthonormal to machine precision.
    """

    R: FloatArray = field(default_factory=lambda: np.eye(3))
    t: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        R, t = np.array(self.R, np.float64), np.array(self.t, np.float64).reshape(-1)
        if R.shape != (3, 3) or t.shape != (3,) or not (np.isfinite(R).all() and np.isfinite(t).all()):
            raise CameraError("The camera's pose needs a finite 3x3 rotation R and a finite translation t of 3 numbers.")
        u, s, vt = np.linalg.svd(R)
        if np.abs(s - 1).max() > 1e-3 or np.linalg.det(R) < 0:
            raise CameraError("The camera's R is not a rotation (it scales, shears or mirrors); give an orthonormal R.")
        self._hold(u @ vt, t)

    def _hold(self, R: FloatArray, t: FloatArray) -> None:
        R.flags.writeable = t.flags.writeable = False
        object.__setattr__(self, "R", R)
        object.__setattr__(self, "t", t)

    def __eq__(self, other: object) -> bool:
        """Whether R and t are the same numbers."""
        return isinstance(other, Pose) and np.array_equal(self.R, other.R) and np.array_equal(self.t, other.t)

    def __hash__(self) -> int:
        return hash(((self.R + 0.0).tobytes(), (self.t + 0.0).tobytes()))  # + 0.0 makes -0 the 0 that it equals

    @classmethod
    def as_it_is(cls, R: FloatArray, t: FloatArray) -> Pose:
        """A pose from the R and t of another one, to the last bit, where making it orthonormal again might turn that."""
        pose = cls()
        pose._hold(R.copy(), t.copy())
        return pose

    @property
    def centre(self) -> FloatArray:
        """Camera centre in the world, (3,): c = -R^T t."""
        return -self.R.T @ self.t

    @classmethod
    def from_centre(cls, R: ArrayLike, centre: ArrayLike) -> Pose:
        """The pose with world-to-camera rotation R and camera centre `centre` (world)."""
        R = np.asarray(R, np.float64)
        return cls(R, -R @ np.asarray(centre, np.float64))

    def relative_to(self, origin: ArrayLike) -> Pose:
        """The same camera among points of which `origin` (3,) was subtracted; itself where that is zero."""
        shift = np.asarray(origin, np.float64)
        return Pose(self.R, self.t + self.R @ shift) if shift.any() else self

    def inverse(self) -> Pose:
        return Pose(self.R.T, -self.R.T @ self.t)

    def __matmul__(self, other: Pose) -> Pose:
        """Composition: (self @ other) applies `other` first."""
        return Pose(self.R @ other.R, self.R @ other.t + self.t)

    def transform(self, points: ArrayLike) -> FloatArray:
        """World points (N, 3) to camera space (N, 3)."""
        return np.asarray(points, np.float64) @ self.R.T + self.t


@dataclass(frozen=True)
class Camera:
    """A posed camera and the image file it belongs to (empty when there is none).

    `focal_guessed`: the focal length is a guess (from EXIF, or by eye), not a calibration.
    `pixel_order`: "stored" for a camera of the photo's pixels before its EXIF rotation, as COLMAP makes them; the engine works
    with upright ones (`photos.fit`).
    """

    intrinsics: Intrinsics
    pose: Pose
    file: str = ""
    focal_guessed: bool = False
    pixel_order: PixelOrder = "upright"

    def relative_to(self, origin: ArrayLike) -> Camera:
        """The same camera among points of which `origin` (3,) was subtracted."""
        return replace(self, pose=self.pose.relative_to(origin))


def rotation_angle_deg(R: ArrayLike) -> float:
    """Angle of a rotation matrix in degrees, accurate near 0 and near 180."""
    R = np.asarray(R, np.float64)
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.degrees(np.arctan2(np.linalg.norm(v), 0.5 * (np.trace(R) - 1))))


def pose_error(estimate: Pose, truth: Pose) -> tuple[float, float]:
    """Distance of the camera centres (scene units) and angle of R_truth^T R (degrees)."""
    return float(np.linalg.norm(estimate.centre - truth.centre)), rotation_angle_deg(truth.R.T @ estimate.R)
