"""Cameras that the user has: in which order they become views of the map, and about how far they look."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry.camera import Camera, Pose
from .candidates import CONE_COS, SIGMA_LOG, weighted_median
from .panorama import panorama_at
from .surface import Surface

TURN_WORTH = 60.0  # degrees of turn that count as much as moving by the depth


def expected_depth(surface: Surface, pose: Pose) -> float:
    """About how far away the surface is that `pose` looks at, scene units; 1 where there is none."""
    if len(surface) == 0:
        return 1.0
    position = pose.centre.astype(np.float32)
    panorama = panorama_at(surface, position, surface.width, SIGMA_LOG)
    ray = surface.points - position
    inside = ray @ pose.R[2].astype(np.float32) > CONE_COS * panorama.distance
    inside = inside if inside.any() else np.ones(len(surface), bool)
    return weighted_median(panorama.distance[inside], panorama.seen[inside] + np.float32(1e-6))


def spread_cameras(cameras: Sequence[Camera], surface: Surface) -> list[Camera]:
    """All cameras, each next one as far as possible from those before it in place and direction: every prefix covers well."""
    if not cameras:
        return []
    depth = float(np.median([expected_depth(surface, camera.pose) for camera in cameras[:: max(1, len(cameras) // 20)]]))
    place = np.array([camera.pose.centre for camera in cameras]) / depth
    way = np.array([camera.pose.R[2] for camera in cameras])
    apart = np.full(len(cameras), np.inf)
    order = [0]
    while len(order) < len(cameras):
        last = order[-1]
        turn = np.degrees(np.arccos(np.clip(way @ way[last], -1, 1))) / TURN_WORTH
        apart = np.minimum(apart, np.linalg.norm(place - place[last], axis=1) + turn)
        apart[order] = -1
        order.append(int(apart.argmax()))
    return [cameras[i] for i in order]
