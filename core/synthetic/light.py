"""Daylight baked into colours: a window as an area light, shadows of boxes, and the dusk of corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.camera import FloatArray

# How many points of the window each surface point is lit by.
SAMPLES = 20
# The light that is everywhere.
BOUNCE = 0.52
DIRECT = 5.2
LIFT = 0.02  # scene units off the surface, so that nothing shades itself
REACH = 0.35  # depth of a corner's dusk, scene units


@dataclass(frozen=True, eq=False)
class LitRoom:
    """Where the light comes from and what stands in its way. `window`: low and high corner of the light's rectangle; `boxes`
    (B, 2, 3): low and high corners of what casts shadows; `hull`: low and high corner of the room. Scene units.
    """

    window: tuple[FloatArray, FloatArray]
    boxes: FloatArray
    hull: tuple[FloatArray, FloatArray]


def daylight(rng: np.random.Generator, points: FloatArray, normals: FloatArray, room: LitRoom) -> FloatArray:
    """Brightness factor (N,) of surface points (N, 3) with unit `normals` (N, 3), for display-encoded colours."""
    low, high = room.window
    start = points + LIFT * normals
    light = np.zeros(len(points))
    cells = (np.arange(SAMPLES) + rng.uniform(0, 1, SAMPLES)) / SAMPLES
    for s, t in zip(cells, rng.permutation(cells), strict=True):
        lamp = low + (high - low) * np.array([s, t, 0.5])
        way = lamp - start
        distance = np.linalg.norm(way, axis=1)
        facing = np.clip(np.einsum("ij,ij->i", way, normals) / distance, 0, None)
        lit = facing > 0
        lit[lit] &= ~_blocked(start[lit], way[lit], room.boxes)
        light += np.where(lit, facing / (1 + distance**2), 0) / SAMPLES
    return np.asarray((BOUNCE * _corner(points, *room.hull) + DIRECT * light) ** (1 / 2.2))


def _blocked(start: FloatArray, way: FloatArray, boxes: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether the segment start .. start + way (N, 3) passes through any box: the slab test."""
    # One row an axis: numpy reduces over long rows many times faster than over many rows of three.
    start, way = np.ascontiguousarray(start.T), np.ascontiguousarray(way.T)
    inverse = 1 / np.where(np.abs(way) < 1e-12, 1e-12, way)
    out = np.zeros(start.shape[1], bool)
    for low, high in boxes:
        a, b = (low[:, None] - start) * inverse, (high[:, None] - start) * inverse
        enter, leave = np.minimum(a, b).max(axis=0), np.maximum(a, b).min(axis=0)
        out |= (enter < leave) & (leave > 0) & (enter < 1)
    return out


def _corner(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """1 in the open, less where two walls meet."""
    walls = np.maximum(np.concatenate([points - low, high - points], axis=1), 0)
    second = np.sort(walls, axis=1)[:, 1]  # the nearest wall is the one a point lies on
    return np.asarray(0.6 + 0.4 * np.clip(second / REACH, 0, 1))
