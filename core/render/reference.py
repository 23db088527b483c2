"""The slow, plain twin of the rasteriser: one Gaussian after the other over the whole image, in float64.

Written to be obviously right, for scenes of some thousand Gaussians; tests hold every fast path against it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Intrinsics, Pose
from ..geometry.conventions import pixel_centres
from ..geometry.quaternion import rotations_of
from ..splats.scene import GaussianScene
from . import constants as c
from .view import RenderedView, RenderSettings

FloatArray = NDArray[np.float64]


def render_reference(
    scene: GaussianScene, intrinsics: Intrinsics, pose: Pose, settings: RenderSettings | None = None
) -> RenderedView:
    """Render with exact INRIA semantics; lens distortion is ignored. Time grows with Gaussians times pixels."""
    near = (settings or RenderSettings()).near
    shape = (intrinsics.height, intrinsics.width)
    transmittance, ended = np.ones(shape), np.zeros(shape, bool)
    color, weight, first, second = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape), np.zeros(shape)
    order = np.argsort(pose.transform(scene.means)[:, 2].astype(np.float32), kind="stable")
    for i in order:
        point = pose.R @ scene.means[i].astype(np.float64) + pose.t
        if not np.float32(point[2]) > near:
            continue
        alpha = _alpha(scene, i, point, intrinsics, pose)
        alpha[alpha < c.ALPHA_MIN] = 0.0
        after = transmittance * (1.0 - alpha)
        ended |= after < c.TRANSMITTANCE_MIN
        w = np.where(ended, 0.0, alpha * transmittance)
        transmittance = np.where(ended, transmittance, after)
        color += w[..., None] * _color(scene, i, pose)
        weight += w
        first += w * point[2]
        second += w * point[2] ** 2
    total = np.maximum(weight, 1e-10)
    depth = first / total
    variance = np.where(weight > 0, np.maximum(second / total - depth**2, 0.0), 0.0)
    return RenderedView(*(a.astype(np.float32) for a in (color, depth, weight, variance)))


def _alpha(scene: GaussianScene, i: int, point: FloatArray, intrinsics: Intrinsics, pose: Pose) -> FloatArray:
    """Opacity of Gaussian i at every pixel, (H, W), before the cut at 1/255; `point` is its mean in camera space (3,)."""
    k = intrinsics
    tan_x, tan_y = 0.5 * k.width / k.fx, 0.5 * k.height / k.fy
    margin = c.JACOBIAN_MARGIN
    x, y, z = point
    u = np.clip(x / z, -(k.cx / k.fx + margin * tan_x), (k.width - k.cx) / k.fx + margin * tan_x)
    v = np.clip(y / z, -(k.cy / k.fy + margin * tan_y), (k.height - k.cy) / k.fy + margin * tan_y)
    jacobian = np.array([[k.fx / z, 0.0, -k.fx * u / z], [0.0, k.fy / z, -k.fy * v / z]])
    axes = jacobian @ pose.R @ rotations_of(scene.rotations[i].astype(np.float64)) * scene.scales[i].astype(np.float64)
    covariance = axes @ axes.T + c.LOWPASS_PX2 * np.eye(2)
    opacity = float(scene.opacities[i])
    if scene.antialiased:
        opacity *= np.sqrt(max(np.linalg.det(axes @ axes.T), 0) / np.linalg.det(covariance))
    conic = np.linalg.inv(covariance)
    dx = pixel_centres(k.width) - (k.fx * x / z + k.cx)
    dy = (pixel_centres(k.height) - (k.fy * y / z + k.cy))[:, None]
    power = -0.5 * (conic[0, 0] * dx**2 + 2 * conic[0, 1] * dx * dy + conic[1, 1] * dy**2)
    return np.asarray(np.minimum(c.ALPHA_MAX, opacity * np.exp(power)))


def _color(scene: GaussianScene, i: int, pose: Pose) -> FloatArray:
    """RGB of Gaussian i seen from the camera centre, (3,)."""
    direction = scene.means[i].astype(np.float64) - pose.centre
    basis = sh_basis(direction / np.linalg.norm(direction), scene.sh_degree)
    return np.asarray(np.maximum(0.0, basis @ scene.sh[i].astype(np.float64) + 0.5))


def sh_basis(direction: FloatArray, degree: int) -> FloatArray:
    """Real spherical harmonics up to `degree` at a unit direction (3,): (K,)."""
    x, y, z = direction
    xx, yy, zz = x * x, y * y, z * z
    basis = [c.SH_C0, -c.SH_C1 * y, c.SH_C1 * z, -c.SH_C1 * x]
    basis += [k * f for k, f in zip(c.SH_C2, (x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy), strict=True)]
    cubic = (
        y * (3 * xx - yy),
        x * y * z,
        y * (4 * zz - xx - yy),
        z * (2 * zz - 3 * xx - 3 * yy),
        x * (4 * zz - xx - yy),
        z * (xx - yy),
        x * (xx - 3 * yy),
    )
    basis += [k * f for k, f in zip(c.SH_C3, cubic, strict=True)]
    return np.array(basis[: (degree + 1) ** 2])
