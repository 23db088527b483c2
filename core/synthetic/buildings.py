"""Places that repeat themselves: a courtyard of equal windows around a pavilion, and a corridor of equal doors.

Axes of a scan (x right, y down, z ahead), metres. Ground and walls differ from place to place in the courtyard; in the corridor
every bay between two doors is the same picture, but for the two end walls.
"""

from __future__ import annotations

import numpy as np

from ..geometry.camera import Camera, FloatArray, Intrinsics, Pose
from ..splats.scene import GaussianScene
from . import textures as tx
from .painted import painted_scene
from .tessellate import Panel, box, panel, tessellate

LENS = Intrinsics(640, 480, 505.0, 505.0, 320.0, 240.0)
YARD, EAVES = 6.0, -4.6  # half the side of the courtyard; height of its walls (y of the eaves, the ground is at 0)
PAVILION = ((-1.2, -2.2, -1.2), (1.2, 0.0, 1.2))
WINDOWS = [(x, y) for y in (100, 300) for x in (60, 250, 440, 630, 820)]  # top-left corners on a wall, in texels
WALL_TEXELS = (460, 960)
BAY, BAYS, CORRIDOR = 2.0, 5, 1.0  # length of a bay, their number, half the width of the corridor
EYE_HEIGHT = -1.6


def courtyard(seed: int = 0, gaussians: int = 24_000) -> GaussianScene:
    """Four walls that look inwards, ten equal windows in each; in the middle a pavilion, seen from outside all round."""
    rng = np.random.default_rng(seed)
    window = tx.window(rng, 110, 90)
    side, low = 2 * YARD, np.array([0.0, EAVES, 0.0])
    panels = [panel(tx.bricks(rng, 700, 700, 26), (-YARD, 0, -YARD), (side, 0, 0), (0, 0, side))]
    for turn in range(4):
        along, towards = _turned((1, 0, 0), turn), _turned((0, 0, 1), turn)
        panels.append(panel(_facade(rng, window), low + YARD * (towards - along), side * along, (0, -EAVES, 0)))
    panels += box([tx.crate(rng, 220, 240, (0.4, 0.3, 0.2)), tx.bricks(rng, 220, 240)], *PAVILION)
    return _painted(rng, panels, gaussians, np.array([0.0, EYE_HEIGHT, -0.8 * YARD]))


def courtyard_cameras(count: int = 8) -> list[Camera]:
    """All around the yard, by turns towards the pavilion and towards the wall across the corner."""
    out = []
    for k in range(count):
        turn = 2 * np.pi * (k + 0.3) / count
        centre = np.array([4.3 * np.sin(turn), EYE_HEIGHT, 4.3 * np.cos(turn)])
        target = np.array([0.0, -1.3, 0.0]) if k % 2 == 0 else np.array([-6 * np.cos(turn), -2.0, 6 * np.sin(turn)])
        out.append(Camera(LENS, _looking(centre, target), f"yard_{k}.jpg"))
    return out


def corridor(seed: int = 0, gaussians: int = 24_000) -> GaussianScene:
    """BAYS bays, each with a door on both sides, all the same; the end walls are not."""
    rng = np.random.default_rng(seed)
    wall, floor, ceiling = _door_wall(rng), tx.planks(rng, 160, 160), tx.plaster(rng, 160, 160, (0.7, 0.7, 0.66))
    width, height, length = 2 * CORRIDOR, 2.6, BAY * BAYS
    panels: list[Panel] = []
    for z in BAY * np.arange(BAYS):
        panels += [
            panel(floor, (-CORRIDOR, 0, z), (width, 0, 0), (0, 0, BAY)),
            panel(ceiling, (-CORRIDOR, -height, z), (width, 0, 0), (0, 0, BAY)),
            panel(wall, (-CORRIDOR, -height, z), (0, 0, BAY), (0, height, 0)),
            panel(wall, (CORRIDOR, -height, z + BAY), (0, 0, -BAY), (0, height, 0)),
        ]
    for z, text in ((0.0, "WEST"), (length, "EAST")):
        panels.append(panel(tx.poster(rng, 260, 200, text), (-CORRIDOR, -height, z), (width, 0, 0), (0, height, 0)))
    return _painted(rng, panels, gaussians, np.array([0.0, EYE_HEIGHT, length / 2]))


def door_camera(bay: float) -> Camera:
    """A camera that sees a door and the print beside it, and nothing else of the corridor."""
    centre = np.array([0.85 * CORRIDOR, EYE_HEIGHT + 0.2, BAY * (bay + 0.5)])
    return Camera(LENS, _looking(centre, centre + np.array([-1.0, 0.05, 0.1])), f"door_{bay}.jpg")


def end_camera() -> Camera:
    """A camera that sees the end wall, which no other place of the corridor is like."""
    centre = np.array([0.1, EYE_HEIGHT, BAY * BAYS - 2.8])
    return Camera(LENS, _looking(centre, np.array([0.0, -1.4, BAY * BAYS])), "end.jpg")


def _painted(rng: tx.Rng, panels: list[Panel], gaussians: int, eye: FloatArray) -> GaussianScene:
    made = tessellate(panels, gaussians, eye)
    return painted_scene(rng, made, np.ones(len(made)))


def _facade(rng: tx.Rng, window: tx.Picture) -> tx.Picture:
    first, second, third = rng.uniform(0.5, 0.8, 3).tolist()
    out = tx.plaster(rng, *WALL_TEXELS, (first, second, third))
    for x, y in WINDOWS:
        out[y : y + window.shape[0], x : x + window.shape[1]] = window
    return out


def _door_wall(rng: tx.Rng) -> tx.Picture:
    """A bay's wall with its door and a print beside it."""
    out = tx.plaster(rng, 260, 200, (0.72, 0.66, 0.5))
    out[60:, 20:110] = tx.crate(rng, 200, 90, (0.35, 0.25, 0.2), "7")
    out[80:190, 120:195] = tx.poster(rng, 110, 75, "IN")
    return out


def _turned(way: tuple[int, int, int], quarters: int) -> FloatArray:
    """`way`, turned by quarter turns about the vertical."""
    x, y, z = way
    for _ in range(quarters):
        x, z = z, -x
    return np.array([x, y, z], np.float64)


def _looking(centre: FloatArray, target: FloatArray) -> Pose:
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return Pose.from_centre(np.stack([x, np.cross(z, x), z]), centre)
