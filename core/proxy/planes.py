"""Depth as the Gaussians lie: each is a plane to the ray that meets it, not a card that faces the camera.

A renderer's expected depth takes the depth of a Gaussian's centre for all of its pixels, so that a floor of large Gaussians has
steps. Along a ray r (z = 1) through the camera's centre a Gaussian of mean m and covariance S is densest at the depth t with

    1 / t = q . r,  q = S^-1 m / (m^T S^-1 m),

which is the plane q . x = 1 (m relative to the camera's centre; compare Zhang et al., "RaDe-GS", 2024, who take it to first
order). q does not depend on the pixel: blended as a colour is, it gives the mean inverse depth of each pixel's ray.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera
from ..render import RenderedView, Renderer, RenderSettings
from ..render.tables import ROWS, SceneTables, build_tables
from ..splats.scene import GaussianScene

Float32Array = NDArray[np.float32]

FLATTEST = 0.2  # of a Gaussian's largest deviation: a thinner one seen edge-on would be a plane through the camera
RANGE_PCT = (0.5, 99.5)  # of the planes in front of the camera: what lies outside is taken to lie at the end
TRUSTED_STD = 2.0  # deviations of the expected depth within which a plane's depth must lie


class PlaneRenderer:
    """Draws a scene's views, and their depth by planes. Draws one at a time."""

    def __init__(self, scene: GaussianScene, settings: RenderSettings) -> None:
        self._tables = build_tables(scene)
        self._settings = settings
        self._views = Renderer(self._tables, settings)
        block = np.empty((ROWS + 3, len(self._tables)), np.float32)
        block[:ROWS] = self._tables.block[:ROWS]
        self._planes = SceneTables(self._tables.origin, block, self._tables.antialiased)

    def render(self, camera: Camera, should_stop: Callable[[], bool]) -> tuple[RenderedView, Float32Array]:
        """The view, and depth by planes (H, W), camera-space z in scene units, the expected one where no plane is to be
        trusted. Raises Cancelled when `should_stop` says True.
        """
        view = self._views.render(camera.intrinsics, camera.pose, should_stop)
        planes = self._towards(camera)
        front = planes[:, self._in_front(camera)]
        low, high = np.percentile(front, RANGE_PCT) if front.size else (0.0, 1.0)
        width = max(float(high - low), 1e-12)
        self._planes.block[ROWS:] = np.clip((planes - low) / width, 0, 1)
        drawn = Renderer(self._planes, self._settings).render(camera.intrinsics, camera.pose, should_stop)
        mean = (low + width * drawn.color / np.maximum(view.alpha, 1e-6)[..., None]).astype(np.float32)
        return view, _depth(mean @ camera.pose.R.T.astype(np.float32), camera, view)

    def _towards(self, camera: Camera) -> Float32Array:
        """q (3, N) of all Gaussians, in the scan's axes."""
        axes = self._tables.body[:9].reshape(3, 3, -1)
        squared = (axes**2).sum(axis=0)
        middle = self._relative(camera)
        least = np.maximum(squared, FLATTEST**2 * squared.max(axis=0))
        # The axes are as long as their deviations; S^-1 m is the sum of u (u . m) / s^2 over unit axes u.
        along = np.einsum("ijn,in->jn", axes, middle) / np.maximum(squared * least, 1e-30)
        toward = np.einsum("ijn,jn->in", axes, along)
        return np.asarray(toward / np.maximum((toward * middle).sum(axis=0), 1e-30), np.float32)

    def _in_front(self, camera: Camera) -> NDArray[np.bool_]:
        return np.asarray(camera.pose.R[2].astype(np.float32) @ self._relative(camera) > self._settings.near)

    def _relative(self, camera: Camera) -> Float32Array:
        """The means (3, N) relative to the camera's centre."""
        centre = (camera.pose.centre - self._tables.origin).astype(np.float32)
        return np.asarray(self._tables.means - centre[:, None])


def _depth(planes: Float32Array, camera: Camera, view: RenderedView) -> Float32Array:
    """From the mean planes (H, W, 3), in the camera's axes."""
    k = camera.intrinsics
    x = (np.arange(k.width, dtype=np.float32) + np.float32(0.5 - k.cx)) / np.float32(k.fx)
    y = (np.arange(k.height, dtype=np.float32) + np.float32(0.5 - k.cy)) / np.float32(k.fy)
    inverse = planes[..., 0] * x + planes[..., 1] * y[:, None] + planes[..., 2]
    with np.errstate(divide="ignore"):
        depth = np.where(inverse > 0, 1 / inverse, 0)
    trusted = np.abs(depth - view.depth) <= TRUSTED_STD * np.sqrt(view.depth_variance) + 0.05 * view.depth
    return np.where(trusted, depth, view.depth).astype(np.float32)
