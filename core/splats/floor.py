"""The floor of a scan: its dominant level plane below the cameras, and which way is up by the photos."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# How far a plane's normal may lean from what is taken for up: photos tell it to some degrees, an unturned scan hardly at all.
MAX_LEAN_DEG = 30.0
# Planes that are tried, and the points that vote on each.
TRIALS, VOTERS = 600, 4000
# A point within this share of the scan's size of a plane lies in it.
THICKNESS = 0.008
# A floor has at least this share of the scan's weight in it, and most of the rest above it.
LEAST_SHARE, LEAST_ABOVE = 0.04, 0.7
# And so many times the weight of the slice just above it, for any slice through walls and things has some.
DISTINCT = 2.0
# Cameras that look in one direction alone tell their horizon, but not how far they are tilted: the second smallest eigenvalue
# of their horizontal axes' mean square must be this large for their common perpendicular to be up.
LEAST_TURN = 0.02


@dataclass(frozen=True, eq=False)
class FloorHints:
    """`up` (3,): about where up is, a unit vector; `centres` (C, 3): places that are above the floor, such as cameras."""

    up: FloatArray
    centres: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Floor:
    """A plane: a `point` (3,) in it, amid what lies in it, and its unit `normal` (3,), upwards; `share`: 0..1 of the scan's
    weight that lies in it.
    """

    point: FloatArray
    normal: FloatArray
    share: float


def vertical_of(right: FloatArray, up: FloatArray) -> FloatArray | None:
    """Which way is up (3,) by photos that were held level, from the cameras' axes to the right and up (C, 3) each.

    However a camera is tilted, its axis to the right stays level: up is what all of these are perpendicular to. Where the
    cameras look one way alone, it is the mean of their own up. None where there is no camera.
    """
    if not len(up):
        return None
    mean = up.sum(axis=0)
    values, vectors = np.linalg.eigh(right.T @ right / len(right))
    found = vectors[:, 0] * (1.0 if vectors[:, 0] @ mean >= 0 else -1.0) if values[1] > LEAST_TURN else mean
    length = float(np.linalg.norm(found))
    return np.asarray(found / length) if length > 1e-9 else None


def find_floor(points: FloatArray, weights: FloatArray, hints: FloorHints, seed: int = 0) -> Floor | None:
    """The floor of Gaussians at `points` (N, 3) with `weights` (N,), such as what each covers; None where none is to be seen.

    Planes through three points each are tried; the one with most weight in it counts, of those that are level by the hints,
    and below which there is next to nothing. It is then fitted to what lies in it.
    """
    low, high = np.quantile(points, (0.05, 0.95), axis=0)
    size = float(np.linalg.norm(high - low))
    if len(points) < 3 or size <= 0:
        return None
    rng = np.random.default_rng(seed)
    share = weights / weights.sum()
    voters = points[rng.choice(len(points), min(VOTERS, len(points)), p=share)]
    normals, starts = _planes(voters[rng.integers(0, len(voters), (TRIALS, 3))], hints.up)
    if not len(normals):
        return None
    heights = voters @ normals.T - (normals * starts).sum(axis=1)
    inside = (np.abs(heights) < THICKNESS * size).mean(axis=0)
    over = ((heights >= THICKNESS * size) & (heights < 3 * THICKNESS * size)).mean(axis=0)
    good = (inside >= LEAST_SHARE) & (inside >= DISTINCT * over) & ((heights > -THICKNESS * size).mean(axis=0) >= LEAST_ABOVE)
    if len(hints.centres):
        good &= ((hints.centres @ normals.T - (normals * starts).sum(axis=1)) > 0).mean(axis=0) > 0.5
    if not good.any():
        return None
    best = int(np.argmax(np.where(good, inside, -1)))
    return _fitted(points, share, Floor(starts[best], normals[best], float(inside[best])), THICKNESS * size)


def _planes(corners: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals, upwards, and a point of each plane through three corners (T, 3, 3) that is level to MAX_LEAN_DEG."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-300)[:, None]
    upwards = normals @ up
    level = (np.abs(upwards) > np.cos(np.radians(MAX_LEAN_DEG))) & (lengths > 0)
    return (normals * np.sign(upwards)[:, None])[level], corners[level, 0]


def _fitted(points: FloatArray, share: FloatArray, floor: Floor, thickness: float) -> Floor:
    """The plane of least squares through what lies in `floor`, again and again while it settles."""
    for _ in range(4):
        inside = np.abs((points - floor.point) @ floor.normal) < thickness
        weight = share[inside]
        if weight.sum() <= 0 or inside.sum() < 3:
            break
        middle = (weight[:, None] * points[inside]).sum(axis=0) / weight.sum()
        off = points[inside] - middle
        normal = np.linalg.eigh((off * weight[:, None]).T @ off)[1][:, 0]
        normal = normal if normal @ floor.normal >= 0 else -normal
        floor = Floor(middle, np.asarray(normal), float(weight.sum()))
    return floor
