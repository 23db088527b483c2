"""The grid's space: even around the cameras, and wider the farther away, so that a cell is about the same part of the depth.

Inside the radius r0 around the centre, which holds the cameras, a place stays where it is. Outside, the distance r becomes
r0 (1 + ln(r / r0)): a cell is as long as it is there times r / r0, and no wider than long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, FloatArray

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class GridSpace:
    """`centre` (3,) in the scan's coordinates, `radius` r0 in its units. Grid coordinates have these units too."""

    centre: FloatArray
    radius: float

    @classmethod
    def around(cls, cameras: Sequence[Camera], depth: float) -> GridSpace:
        """For surfaces that begin at about `depth` from the cameras, scene units: the even part holds all of the cameras."""
        centres = np.array([camera.pose.centre for camera in cameras])
        middle = (centres.min(axis=0) + centres.max(axis=0)) / 2
        return cls(middle, max(depth, float(np.linalg.norm(centres - middle, axis=1).max())))

    def to_grid(self, points: NDArray[np.floating]) -> Float32Array:
        """Places (N, 3), relative to the centre, in the grid (N, 3)."""
        distance = np.linalg.norm(points, axis=1, keepdims=True)
        far = np.maximum(distance / self.radius, 1)
        return np.asarray(points * ((1 + np.log(far)) / far), np.float32)

    def from_grid(self, places: NDArray[np.floating]) -> Float32Array:
        """Inverse of `to_grid`."""
        distance = np.linalg.norm(places, axis=1, keepdims=True)
        beyond = np.maximum(distance / self.radius - 1, 0)
        return np.asarray(places * (np.exp(beyond) / (1 + beyond)), np.float32)

    def scale(self, points: NDArray[np.floating]) -> Float32Array:
        """How long a unit of the grid is at places (N, 3) relative to the centre, (N,)."""
        return np.asarray(np.maximum(np.linalg.norm(points, axis=1) / self.radius, 1), np.float32)
