"""A room rendered by ray casting: an exact stand-in for a splat renderer that shares no code with the rasteriser.

Six painted walls of a box and a few painted pillars; every pixel is the wall's picture at the exact hit point.
"""

from itertools import product

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import so3_exp
from core.photos.photo import Photo
from core.render.view import RenderedView

HALF = np.array([3.0, 2.0, 4.0])
PILLARS = [((-1.2, -2.0, 1.0), (-0.6, 2.0, 1.6)), ((1.0, 0.3, 1.8), (2.2, 2.0, 2.6)), ((-0.2, 1.0, 0.4), (0.5, 2.0, 1.0))]
TEXELS_PER_UNIT = 120

# A camera in the room, with a lens that bends, and what it looks at.
LENS = Intrinsics(320, 240, 260.0, 258.0, 163.0, 118.0, (-0.08, 0.02, 0.001, -0.0005, 0.0))
TRUTH = Pose.from_centre(so3_exp([0.05, 0.2, 0.02]), [-0.4, 0.1, -2.6])
DEPTH = 4.5  # about the median depth from there


def _picture(rng, size=1024):
    """Smooth noise on several scales: blobs for every octave of a feature detector, nowhere repeated."""
    image = np.zeros((size, size, 3), np.float32)
    for cell in (4, 8, 16, 32, 64):
        coarse = rng.normal(size=(size // cell, size // cell, 3)).astype(np.float32)
        image += cell**0.35 * cv2.resize(coarse, (size, size), interpolation=cv2.INTER_CUBIC)
    return np.clip(0.5 + 0.12 * image, 0, 1)


class BoxRoom:
    """`render` like a Renderer's; `photo` takes a distorted picture of the room, with the exact camera as its truth."""

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        self.pictures = [[_picture(rng), _picture(rng)] for _ in range(3)]  # by the side it is seen from
        self.calls = 0

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        self.calls += 1
        v, u = np.mgrid[: intrinsics.height, : intrinsics.width] + 0.5
        rays = np.stack([(u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, np.ones_like(u)], -1)
        color, depth = self._cast(rays.reshape(-1, 3), pose)
        shape = (intrinsics.height, intrinsics.width)
        hit = np.isfinite(depth)
        depth = np.where(hit, depth, 0).astype(np.float32).reshape(shape)
        alpha = hit.astype(np.float32).reshape(shape)
        return RenderedView(color.astype(np.float32).reshape(*shape, 3), depth, alpha, np.zeros(shape, np.float32))

    def photo(self, intrinsics: Intrinsics, pose: Pose, seed=0, gain=0.8, noise=0.01) -> Photo:
        v, u = np.mgrid[: 2 * intrinsics.height, : 2 * intrinsics.width] * 0.5 + 0.25
        n = intrinsics.normalise(np.stack([u.ravel(), v.ravel()], 1))
        color, _ = self._cast(np.column_stack([n, np.ones(len(n))]), pose)
        full = color.reshape(2 * intrinsics.height, 2 * intrinsics.width, 3)
        small = full.reshape(intrinsics.height, 2, intrinsics.width, 2, 3).mean((1, 3))
        rng = np.random.default_rng(seed)
        exposed = gain * small**1.1 + noise * rng.normal(size=small.shape)
        return Photo(np.clip(exposed * 255 + 0.5, 0, 255).astype(np.uint8))

    def _cast(self, rays, pose):
        """Colour (N, 3) and camera z (N,) of the first hit; rays have camera z = 1, so the ray parameter is the depth."""
        origin, direction = pose.centre, rays @ pose.R
        with np.errstate(divide="ignore", invalid="ignore"):
            walls = np.where(direction > 0, (HALF - origin) / direction, (-HALF - origin) / direction)
            inside = bool((np.abs(origin) < HALF).all())
            best = np.where(inside, walls.min(1), np.inf)
            axis = walls.argmin(1)
            for low, high in PILLARS:
                a, b = (np.array(low) - origin) / direction, (np.array(high) - origin) / direction
                near, far = np.minimum(a, b), np.maximum(a, b)
                enter = near.max(1)
                hit = (enter < far.min(1)) & (enter > 1e-3) & (enter < best)
                best, axis = np.where(hit, enter, best), np.where(hit, near.argmax(1), axis)
        point = origin + np.where(np.isfinite(best), best, 0)[:, None] * direction
        color = np.zeros((len(rays), 3))
        for k, side in product(range(3), range(2)):
            on = (axis == k) & np.isfinite(best) & ((direction[:, k] > 0) == bool(side))
            s, t = (TEXELS_PER_UNIT * point[on][:, [(k + 1) % 3, (k + 2) % 3]]).T
            for channel in range(3):
                picture = self.pictures[k][side][:, :, channel]
                color[on, channel] = map_coordinates(picture, [t, s], order=1, mode="grid-wrap")
        return color, best


def start_off(ratio, degrees, seed=0):
    """A pose `ratio` of the depth and `degrees` away from TRUTH, in directions that `seed` draws."""
    rng = np.random.default_rng(seed)
    way, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    return Pose.from_centre(so3_exp(np.radians(degrees) * axis) @ TRUTH.R, TRUTH.centre + ratio * DEPTH * way)
