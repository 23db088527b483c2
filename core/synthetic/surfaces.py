"""Flat Gaussians on round and leafy things; flat walls and boxes are `tessellate`'s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.camera import FloatArray
from .textures import Picture, Rng

SH_C0 = 0.28209479177387814
# Deviation within the surface, as a share of the spacing: neighbours join without a blur.
FILL = 0.6
THICKNESS = 0.08


@dataclass(frozen=True, eq=False)
class Surfels:
    """N flat Gaussians: centres (N, 3), axes (N, 3, 3) as columns, deviations (N, 3), colours (N, 3) 0..1."""

    centres: FloatArray
    axes: FloatArray
    scales: FloatArray
    colors: FloatArray

    def __len__(self) -> int:
        return len(self.centres)


def ball(picture: Picture, centre: ArrayLike, radius: float, spacing: float) -> Surfels:
    """A painted sphere."""
    n = max(16, round(4 * np.pi * radius**2 / spacing**2))
    k = np.arange(n) + 0.5
    polar, turn = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    normal = np.stack([np.cos(turn) * np.sin(polar), np.cos(polar), np.sin(turn) * np.sin(polar)], axis=1)
    row = np.clip(polar / np.pi * picture.shape[0], 0, picture.shape[0] - 1).astype(int)
    column = ((turn / (2 * np.pi)) % 1 * picture.shape[1]).astype(int)
    colors = picture[row, column].astype(np.float64)
    scales = np.tile([FILL * spacing, FILL * spacing, THICKNESS * spacing], (n, 1))
    return Surfels(np.asarray(centre, float) + radius * normal, _frames(normal), scales, colors)


def leaves(rng: Rng, centre: ArrayLike, radius: float, count: int) -> Surfels:
    """A bush: long flat Gaussians of many greens, turned every way."""
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    centres = np.asarray(centre, float) + way * (radius * rng.uniform(0.3, 1.0, count)[:, None])
    axes = _frames(way + 0.6 * rng.normal(size=(count, 3)))
    scales = np.column_stack([rng.uniform(0.02, 0.05, count), rng.uniform(0.008, 0.016, count), np.full(count, 0.002)])
    green = np.array([0.18, 0.42, 0.14]) * rng.uniform(0.4, 1.8, (count, 1)) + rng.normal(0, 0.05, (count, 3))
    return Surfels(centres, axes, scales, np.clip(green, 0.02, 0.95))


def _frames(normals: FloatArray) -> FloatArray:
    """Right-handed frames (N, 3, 3) whose third column is along each normal."""
    n = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    helper = np.where(np.abs(n[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(helper, n)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.stack([u, np.cross(n, u), n], axis=2)
