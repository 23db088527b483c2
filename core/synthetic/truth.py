"""The exact depth of the sample room, by rays that meet its walls, boxes and balls: what a depth, or a mesh, is held to."""

from __future__ import annotations

import numpy as np

from ..geometry.camera import Camera, FloatArray
from ..geometry.conventions import pixel_centres
from .room import BALLS, BUSH, panels
from .tessellate import Panel

BUSH_REACH = 1.25  # radii of the bush within which its leaves lie, which are no surface


def exact_depth(camera: Camera) -> FloatArray:
    """Camera-space z (H, W) in scene units at each pixel's centre, for a pinhole; infinite where a ray leaves the room, NaN
    where it passes through the bush.
    """
    k, pose = camera.intrinsics, camera.pose
    x, y = np.meshgrid((pixel_centres(k.width) - k.cx) / k.fx, (pixel_centres(k.height) - k.cy) / k.fy)
    local = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    rays = local @ pose.R  # its z is 1 in the camera, so that lengths along it are depths
    depth = np.full(len(rays), np.inf)
    for flat in panels(np.random.default_rng(0)):
        depth = np.minimum(depth, _to_panel(pose.centre, rays, flat))
    for centre, radius in BALLS:
        depth = np.minimum(depth, _to_ball(pose.centre, rays, np.array(centre), radius))
    bush = _to_ball(pose.centre, rays, np.array(BUSH[0]), BUSH_REACH * BUSH[1])
    return np.asarray(np.where(bush < depth, np.nan, depth).reshape(x.shape))


def _to_panel(eye: FloatArray, rays: FloatArray, flat: Panel) -> FloatArray:
    """How far rays (N, 3) go until they meet a rectangle (N,), infinite where they do not."""
    to_corner = flat.origin - eye
    with np.errstate(divide="ignore", invalid="ignore"):
        length = (to_corner @ flat.normal) / (rays @ flat.normal)
        there = length[:, None] * rays - to_corner
        inside = [(share >= 0) & (share <= 1) for share in (there @ side / (side @ side) for side in (flat.across, flat.down))]
    return np.asarray(np.where((length > 0) & inside[0] & inside[1], length, np.inf))


def _to_ball(eye: FloatArray, rays: FloatArray, centre: FloatArray, radius: float) -> FloatArray:
    """As `_to_panel`, for the near side of a ball."""
    away = eye - centre
    a, b, c = (rays**2).sum(axis=1), rays @ away, away @ away - radius**2
    root = b * b - a * c
    length = (-b - np.sqrt(np.maximum(root, 0))) / a
    return np.asarray(np.where((root > 0) & (length > 0), length, np.inf))
