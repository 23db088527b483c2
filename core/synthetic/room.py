"""The sample: a furnished study of about 40,000 Gaussians, axes of a scan (x right, y down, z into the room), metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..splats.scene import GaussianScene
from . import textures as tx
from .light import LitRoom, daylight
from .painted import joined, painted_scene
from .surfaces import Surfels, ball, leaves
from .tessellate import Panel, box, panel, tessellate

LEFT, RIGHT, CEILING, FLOOR, FRONT, BACK = -2.1, 2.1, -1.3, 1.3, -0.6, 4.4
HULL = (np.array([LEFT, CEILING, FRONT]), np.array([RIGHT, FLOOR, BACK]))
EYE = np.array([0.0, -0.1, 0.1])  # about where the sample cameras stand: detail goes where they see it
WINDOW = (np.array([-1.0, -1.0, BACK - 0.1]), np.array([0.1, 0.3, BACK - 0.1]))
BALL_SPACING, LEAVES = 0.021, 1500  # at the full 40,000
FULL_COUNT = 40_000

BOXES = {  # low and high corner of everything that stands in the room
    "bookcase": ((-2.05, -1.0, 4.05), (-1.2, FLOOR, BACK)),
    "chest": ((-0.55, 0.75, 2.6), (0.45, FLOOR, 3.2)),
    "cupboard": ((1.2, 0.55, 3.2), (1.95, FLOOR, 3.9)),
    "case": ((1.3, 0.15, 3.35), (1.75, 0.55, 3.75)),
    "seat": ((1.2, 0.85, 1.6), (1.85, FLOOR, 2.4)),
    "back": ((1.85, 0.35, 1.55), (2.08, FLOOR, 2.45)),
    "pot": ((-1.5, 0.9, 3.2), (-1.1, FLOOR, 3.6)),
}
BALLS = (((-0.05, 0.55, 2.9), 0.2), ((0.75, 1.1, 2.0), 0.19))
BUSH = ((-1.3, 0.55, 3.4), 0.42)


def make_scene(seed: int = 0, gaussians: int = FULL_COUNT) -> GaussianScene:
    """The room, SH degree 1, of `gaussians` Gaussians; fewer of them show it less finely."""
    rng = np.random.default_rng(seed)
    share = gaussians / FULL_COUNT
    loose = _round_things(rng, share)
    flat = tessellate(panels(rng), gaussians - sum(map(len, loose)), EYE)
    return _to_scene(rng, joined([flat, *loose]))


def panels(rng: tx.Rng) -> list[Panel]:
    """Everything in the room that is flat; where it is does not depend on `rng`, which paints it."""
    return _shell(rng) + _furniture(rng)


def _shell(rng: tx.Rng) -> list[Panel]:
    wide, tall, deep = RIGHT - LEFT, FLOOR - CEILING, BACK - FRONT
    return [
        panel(tx.planks(rng, 700, 600), (LEFT, FLOOR, BACK), (wide, 0, 0), (0, 0, -deep)),
        panel(tx.bricks(rng, 440, 700), (LEFT, CEILING, BACK), (wide, 0, 0), (0, tall, 0)),
        panel(tx.plaster(rng, 400, 700, (0.78, 0.7, 0.52)), (LEFT, CEILING, FRONT), (0, 0, deep), (0, tall, 0)),
        panel(tx.plaster(rng, 400, 700, (0.45, 0.57, 0.6)), (RIGHT, CEILING, BACK), (0, 0, -deep), (0, tall, 0)),
        panel(tx.plaster(rng, 400, 400, (0.7, 0.69, 0.66)), (LEFT, CEILING, FRONT), (wide, 0, 0), (0, 0, deep)),
    ]


def _furniture(rng: tx.Rng) -> list[Panel]:
    wall, right = BACK - 0.02, RIGHT - 0.02
    wood, pine, red = (0.42, 0.28, 0.17), (0.5, 0.34, 0.2), (0.55, 0.14, 0.16)
    sea = (0.24, 0.42, 0.48)
    parts = [
        panel(tx.rug(rng, 420, 560), (-1.15, FLOOR - 0.01, 3.35), (2.3, 0, 0), (0, 0, -1.75)),
        panel(tx.window(rng, 390, 330), (-1.0, -1.0, wall), (1.1, 0, 0), (0, 1.3, 0)),
        panel(tx.poster(rng, 420, 300, "ORBIT"), (0.35, -0.95, wall), (0.75, 0, 0), (0, 1.05, 0)),
        panel(tx.poster(rng, 300, 300, "No 7"), (1.3, -0.8, wall), (0.65, 0, 0), (0, 0.65, 0)),
        panel(tx.poster(rng, 300, 420, "ATLAS"), (right, -0.85, 3.9), (0, 0, -1.2), (0, 0.85, 0)),
        panel(tx.poster(rng, 380, 280, "TIDE"), (right, -0.8, 2.1), (0, 0, -0.7), (0, 0.95, 0)),
        panel(tx.poster(rng, 380, 560, "HARBOUR"), (LEFT + 0.02, -0.8, 2.3), (0, 0, 1.4), (0, 0.95, 0)),
    ]
    case = tx.crate(rng, 400, 120, wood)
    parts += box([tx.books(rng, 640, 240, 6), case, case, case, tx.crate(rng, 80, 200, wood)], *BOXES["bookcase"])
    parts += box([tx.crate(rng, 220, 400, pine, "GS-7"), tx.crate(rng, 220, 260, pine)], *BOXES["chest"])
    parts += box([tx.crate(rng, 300, 300, sea, "K12"), tx.crate(rng, 300, 280, sea)], *BOXES["cupboard"])
    parts += box([tx.crate(rng, 160, 180, (0.62, 0.5, 0.18), "B3")], *BOXES["case"])
    parts += box([tx.tartan(rng, 200, 280, red)], *BOXES["seat"]) + box([tx.tartan(rng, 300, 260, red)], *BOXES["back"])
    return parts + box([tx.rug(rng, 160, 200)], *BOXES["pot"])


def _round_things(rng: tx.Rng, share: float) -> list[Surfels]:
    spacing = BALL_SPACING / np.sqrt(share)
    pictures = (tx.rug(rng, 260, 360), tx.bricks(rng, 120, 200, 16))
    balls = [ball(picture, centre, radius, spacing) for picture, (centre, radius) in zip(pictures, BALLS, strict=True)]
    return [*balls, leaves(rng, *BUSH, round(LEAVES * share))]


def _to_scene(rng: tx.Rng, made: Surfels) -> GaussianScene:
    axes = made.axes.copy()
    away = np.einsum("ij,ij->i", axes[:, :, 2], made.centres - EYE) > 0
    axes[away] *= (1, -1, -1)  # the third axis is the side that is seen, and the frame stays right-handed
    balls = np.array([[np.subtract(centre, 0.6 * radius), np.add(centre, 0.6 * radius)] for centre, radius in BALLS])
    solid = np.concatenate([np.array(list(BOXES.values())), balls])
    shade = daylight(rng, made.centres, axes[:, :, 2], LitRoom(WINDOW, solid, HULL))
    return painted_scene(rng, replace(made, axes=axes), shade)
