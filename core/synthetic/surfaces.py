"""Gaussians laid on surfaces: painted rectangles, boxes, balls and leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import FloatArray
from .textures import Picture, Rng

SH_C0 = 0.28209479177387814
FILL = 0.6  # deviation in the surface, as a share of the spacing: neighbours melt without a blur
THICKNESS = 0.08


@dataclass(frozen=True)
class Surfels:
    """N flat Gaussians: centres (N, 3), axes (N, 3, 3) as columns, deviations (N, 3), colours (N, 3) 0..1."""

    centres: FloatArray
    axes: FloatArray
    scales: FloatArray
    colors: FloatArray

    def __len__(self) -> int:
        return len(self.centres)

    def shaded(self, factor: NDArray[np.float64]) -> Surfels:
        """The same with colours times `factor` (N,)."""
        return Surfels(self.centres, self.axes, self.scales, np.clip(self.colors * factor[:, None], 0.01, 0.99))


def rectangle(rng: Rng, picture: Picture, origin: ArrayLike, across: ArrayLike, down: ArrayLike, spacing: float) -> Surfels:
    """A painted rectangle: `origin` is the picture's top-left corner, `across` and `down` its edges, in scene units."""
    o, u, v = (np.asarray(x, np.float64) for x in (origin, across, down))
    width, height = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    columns, rows = max(1, round(width / spacing)), max(1, round(height / spacing))
    s, t = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    jitter = rng.uniform(-0.15, 0.15, (2, rows, columns))
    s, t = (s + jitter[0] / columns).ravel(), (t + jitter[1] / rows).ravel()
    pixel = np.stack([t * picture.shape[0], s * picture.shape[1]]).astype(int)
    color = picture[np.clip(pixel[0], 0, picture.shape[0] - 1), np.clip(pixel[1], 0, picture.shape[1] - 1)]
    axes = np.column_stack([u / width, v / height, np.cross(u / width, v / height)])
    scales = [FILL * width / columns, FILL * height / rows, THICKNESS * spacing]
    n = len(s)
    return Surfels(
        o + s[:, None] * u + t[:, None] * v, np.tile(axes, (n, 1, 1)), np.tile(scales, (n, 1)), color.astype(np.float64)
    )


def box(rng: Rng, pictures: list[Picture], low: ArrayLike, high: ArrayLike, spacing: float) -> list[Surfels]:
    """The five visible faces of a box in a y-down world: front (low z), left, right, back, top (low y)."""
    (x0, y0, z0), (x1, y1, z1) = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag([x1 - x0, y1 - y0, z1 - z0])
    faces = [
        ((x0, y0, z0), x, y),
        ((x0, y0, z1), -z, y),
        ((x1, y0, z0), z, y),
        ((x1, y0, z1), -x, y),
        ((x0, y0, z1), x, -z),
    ]
    return [rectangle(rng, pictures[k % len(pictures)], *face, spacing) for k, face in enumerate(faces)]


def ball(rng: Rng, picture: Picture, centre: ArrayLike, radius: float, spacing: float) -> Surfels:
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
