"""A render as a proxy needs it: depth without the pixels that stand between two surfaces, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, FloatArray, Intrinsics
from ..geometry.conventions import pixel_centres
from ..render.view import RenderedView

Float32Array = NDArray[np.float32]

MIN_ALPHA = 0.5  # a pixel below it shows the background as much as the scan
JUMP = 0.03  # of the depth: neighbours that are farther apart belong to two surfaces
BEND = 0.003  # of the depth, from pixel to pixel: less is no jump, but a steep surface
# Of a pixel, from which on it counts as the near surface's: Gaussians at an edge reach out over it, some pixels wide.
NEAR_SHARE = 0.75
RIPPLE = 0.02  # of the depth: the deviation of the filter that takes ripples out
NOWHERE = 1e-20  # in place of a depth of 0, which has no logarithm
MARGIN, MOST_BENT = 0.03, 0.3  # of the picture's longer side; of each side
REACH_PX = 2  # how far from a jump a pixel may show both surfaces
MIN_STD = 0.005  # of the depth: no depth is taken to be known better
GRAZING = 0.1  # the least cosine between a ray and a surface's normal


@dataclass(frozen=True, eq=False)
class DepthView:
    """A camera without distortion and, for its pixels (H, W): `depth`, camera-space z in scene units, 0 where there is none;
    `weight`, an inverse variance; `slope`, the distance of a point from the surface for each unit of z before it;
    `color` (H, W, 3), RGB 0..1.
    """

    camera: Camera
    depth: Float32Array
    weight: Float32Array
    slope: Float32Array
    color: Float32Array

    @classmethod
    def of(cls, camera: Camera, view: RenderedView, depth: Float32Array, smooth_px: float = 0.0) -> DepthView:
        """`camera` drew the view, whose distortion was ignored; `depth` (H, W) is the best that is known of it. `smooth_px` as
        in ProxySettings.
        """
        camera = replace(camera, intrinsics=camera.intrinsics.pinhole())
        depth = sharpened(np.where(view.alpha >= MIN_ALPHA, depth, 0).astype(np.float32))
        depth = smoothed(depth, smooth_px) if smooth_px > 0 else depth
        slope = _slope(camera.intrinsics, depth)
        variance = view.depth_variance + (MIN_STD * depth) ** 2
        weight = np.where(depth > 0, view.alpha**2 * slope**2 / np.maximum(variance, 1e-20), 0)
        return cls(camera, depth, weight.astype(np.float32), slope, np.clip(view.color, 0, 1))

    def points(self, step: int) -> FloatArray:
        """Where the pixels lie, in the scan's coordinates (N, 3): those that have a depth, of every `step`th row and column."""
        k, depth = self.camera.intrinsics, self.depth[::step, ::step]
        rays = _rays(k)[::step, ::step][depth > 0]
        local = rays.astype(np.float64) * depth[depth > 0][:, None]
        return self.camera.pose.inverse().transform(local)


def covering(k: Intrinsics) -> Intrinsics:
    """A pinhole that sees all of a photo whose lens bends, and MARGIN more to each side, for the mesh ends within the views."""
    shares = np.linspace(0, 1, 17)
    corners = [(s, t) for s in shares for t in shares if {s, t} & {0.0, 1.0}]
    rim = k.undistort(np.array(corners) * (k.width, k.height))
    size = np.array([k.width, k.height])
    # Where a lens model folds over, far out, its inverse may be anything.
    low = np.maximum(np.minimum(rim.min(axis=0), 0), -MOST_BENT * size) - MARGIN * size.max()
    high = np.minimum(np.maximum(rim.max(axis=0), size), (1 + MOST_BENT) * size) + MARGIN * size.max()
    width, height = np.ceil(high - low).astype(int).tolist()
    return Intrinsics(width, height, k.fx, k.fy, k.cx - float(low[0]), k.cy - float(low[1]))


def sharpened(depth: Float32Array) -> Float32Array:
    """Depth (H, W) in which a pixel near a jump has the depth of the surface that it shows; 0 stays 0.

    Where a pixel shows two surfaces, its depth by planes is the mean of their inverse depths, which is a surface that is not
    there, and would make a bridge between the two.
    """
    known = depth > 0
    kernel = np.ones((2 * REACH_PX + 1,) * 2, np.uint8)
    far = cv2.dilate(depth, kernel)
    near = cv2.erode(np.where(known, depth, np.float32(np.inf)), kernel)
    with np.errstate(divide="ignore", invalid="ignore"):
        # The inverse depth of a plane is linear in the picture, however steep it is.
        inverse = np.where(known, 1 / depth, 0).astype(np.float32)
        bend = np.maximum(_bend(inverse), _bend(inverse.T).T) * depth
        bridge = known & (far - near > JUMP * near) & (cv2.dilate(bend, kernel) > BEND)
        is_near = inverse > NEAR_SHARE / near + (1 - NEAR_SHARE) / far
    return np.where(bridge, np.where(is_near, near, far), depth).astype(np.float32)


def smoothed(depth: Float32Array, width_px: float) -> Float32Array:
    """Depth (H, W) without the ripples that Gaussians leave in a surface, which would catch light and shadow; jumps and 0 stay.

    A bilateral filter (Tomasi and Manduchi, 1998) of the logarithm, so that the ripples' size is a share of the depth.
    """
    known = depth > 0
    logs = np.where(known, np.log(np.maximum(depth, NOWHERE)), np.float32(np.log(NOWHERE))).astype(np.float32)
    found = cv2.bilateralFilter(logs, -1, RIPPLE, width_px)
    return np.where(known, np.exp(found), 0).astype(np.float32)


def _bend(values: Float32Array) -> Float32Array:
    """The second differences along the rows (H, W), without sign; 0 at their ends."""
    out = np.zeros(values.shape, np.float32)
    out[:, 1:-1] = np.abs(values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2])
    return out


def _rays(k: Intrinsics) -> Float32Array:
    """Directions (H, W, 3) with z = 1."""
    x, y = (pixel_centres(k.width) - k.cx) / k.fx, (pixel_centres(k.height) - k.cy) / k.fy
    return np.dstack([*np.meshgrid(x, y), np.ones((k.height, k.width))]).astype(np.float32)


def _slope(k: Intrinsics, depth: Float32Array) -> Float32Array:
    """|n . ray| of the unit normal n, for rays with z = 1. The differences go to whichever neighbour is nearer in depth, hence
    not over a jump.
    """
    rays = _rays(k)
    points = rays * depth[..., None]
    normal = np.cross(_difference(points, depth, 1), _difference(points, depth, 0))
    length = np.linalg.norm(normal, axis=2)
    along = np.abs((normal * rays).sum(axis=2)) / np.maximum(length, 1e-20)
    return np.where(length > 0, np.maximum(along, GRAZING), 1).astype(np.float32)


def _difference(points: Float32Array, depth: Float32Array, axis: int) -> Float32Array:
    ahead, before = (np.roll(points, shift, axis) - points for shift in (-1, 1))
    near = np.abs(np.roll(depth, -1, axis) - depth) <= np.abs(np.roll(depth, 1, axis) - depth)
    return np.where(near[..., None], ahead, -before)
