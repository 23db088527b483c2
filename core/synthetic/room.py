"""The sample: a furnished study of about 40,000 Gaussians, axes of a scan (x right, y down, z into the room), metres."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..camera import FloatArray
from ..splats.scene import GaussianScene
from . import textures as tx
from .surfaces import SH_C0, Surfels, ball, box, leaves, rectangle

LEFT, RIGHT, CEILING, FLOOR, FRONT, BACK = -2.1, 2.1, -1.3, 1.3, -0.6, 4.4
OPACITY = 0.96
GLOSS = 0.05  # size of the first-degree SH coefficients: what changes with the direction it is seen from


def make_scene(seed: int = 0, gaussians: int = 40_000) -> GaussianScene:
    """The room, SH degree 1. `gaussians` sets how finely it is made: the count comes out within a few per cent of it."""
    rng = np.random.default_rng(seed)
    parts = _shell(rng, 1.0) + _furniture(rng, 1.0)
    # The count falls with the square of the spacing; leaves are a fixed share of it.
    fine = float(np.sqrt(sum(map(len, parts)) / gaussians))
    rng = np.random.default_rng(seed)
    return _to_scene(rng, [_lit(part) for part in _shell(rng, fine) + _furniture(rng, fine)])


def _shell(rng: tx.Rng, fine: float) -> list[Surfels]:
    wide, tall, deep = RIGHT - LEFT, FLOOR - CEILING, BACK - FRONT
    floor = tx.planks(rng, 700, 600)
    return [
        rectangle(rng, floor, (LEFT, FLOOR, BACK), (wide, 0, 0), (0, 0, -deep), 0.045 * fine),
        rectangle(rng, tx.bricks(rng, 440, 700), (LEFT, CEILING, BACK), (wide, 0, 0), (0, tall, 0), 0.036 * fine),
        rectangle(
            rng, tx.plaster(rng, 400, 700, (0.72, 0.66, 0.5)), (LEFT, CEILING, FRONT), (0, 0, deep), (0, tall, 0), 0.07 * fine
        ),
        rectangle(
            rng, tx.plaster(rng, 400, 700, (0.45, 0.55, 0.58)), (RIGHT, CEILING, BACK), (0, 0, -deep), (0, tall, 0), 0.07 * fine
        ),
        rectangle(
            rng, tx.plaster(rng, 400, 400, (0.8, 0.8, 0.78)), (LEFT, CEILING, FRONT), (wide, 0, 0), (0, 0, deep), 0.09 * fine
        ),
    ]


def _furniture(rng: tx.Rng, fine: float) -> list[Surfels]:
    detail = 0.021 * fine
    parts = [
        rectangle(rng, tx.rug(rng, 420, 560), (-1.15, FLOOR - 0.01, 3.35), (2.3, 0, 0), (0, 0, -1.75), 0.026 * fine),
        rectangle(rng, tx.window(rng, 360, 300), (-1.75, -0.95, BACK - 0.02), (1.1, 0, 0), (0, 1.3, 0), detail),
        rectangle(rng, tx.poster(rng, 420, 300, "ORBIT"), (-0.25, -0.9, BACK - 0.02), (0.8, 0, 0), (0, 1.1, 0), detail),
        rectangle(rng, tx.poster(rng, 300, 300, "No 7"), (0.85, -0.75, BACK - 0.02), (0.7, 0, 0), (0, 0.7, 0), detail),
        rectangle(rng, tx.books(rng, 460, 620, 4), (LEFT + 0.03, -0.75, 1.1), (0, 0, 1.9), (0, 1.95, 0), detail),
        rectangle(rng, tx.poster(rng, 300, 420, "ATLAS"), (RIGHT - 0.02, -0.85, 3.7), (0, 0, -1.2), (0, 0.85, 0), detail),
        rectangle(rng, tx.poster(rng, 380, 280, "TIDE"), (RIGHT - 0.02, -0.8, 2.1), (0, 0, -0.7), (0, 0.95, 0), detail),
    ]
    parts += box(rng, [tx.crate(rng, 150, 200, (0.55, 0.36, 0.2), "GS-7")], (-0.55, 0.75, 2.6), (0.45, 1.29, 3.2), detail)
    parts += box(rng, [tx.crate(rng, 200, 160, (0.2, 0.4, 0.5), "K12")], (1.2, 0.55, 3.2), (1.85, 1.29, 3.9), detail)
    parts += box(rng, [tx.crate(rng, 120, 160, (0.6, 0.5, 0.15), "B3")], (1.3, 0.15, 3.35), (1.75, 0.55, 3.75), detail)
    parts += box(rng, [tx.crate(rng, 160, 220, (0.5, 0.15, 0.18), "")], (1.25, 0.8, 1.5), (2.0, 1.29, 2.4), detail)
    parts.append(ball(rng, tx.rug(rng, 260, 360), (-0.05, 0.55, 2.9), 0.2, detail))
    parts.append(ball(rng, tx.bricks(rng, 120, 200, 16), (0.75, 1.1, 2.0), 0.19, detail))
    pot = tx.crate(rng, 120, 120, (0.7, 0.35, 0.22), "")
    parts += box(rng, [pot], (-1.85, 0.85, 3.5), (-1.4, 1.29, 3.95), detail)
    parts.append(leaves(rng, (-1.62, 0.45, 3.72), 0.5, round(1800 / fine**2)))
    return parts


def _lit(part: Surfels) -> Surfels:
    """Light from the window at the back left, and the dusk of the corners."""
    c = part.centres
    lamp = np.array([-1.2, -0.3, BACK - 0.6])
    near = 1 / (1 + 0.09 * ((c - lamp) ** 2).sum(1))
    walls = np.stack([c[:, 0] - LEFT, RIGHT - c[:, 0], BACK - c[:, 2], FLOOR - c[:, 1], c[:, 1] - CEILING], axis=1)
    corner = np.sort(np.maximum(walls, 0), axis=1)[:, 1]  # the second nearest wall tells how deep in a corner a point is
    return part.shaded((0.55 + 0.6 * near) * (0.72 + 0.28 * np.clip(corner / 0.35, 0, 1)))


def _to_scene(rng: tx.Rng, parts: list[Surfels]) -> GaussianScene:
    axes = np.concatenate([p.axes for p in parts])
    axes[np.linalg.det(axes) < 0, :, 2] *= -1
    quaternions = Rotation.from_matrix(axes).as_quat()[:, [3, 0, 1, 2]]
    colors = np.concatenate([p.colors for p in parts])
    n = len(colors)
    sh = np.zeros((n, 4, 3), np.float32)
    sh[:, 0] = (colors - 0.5) / SH_C0
    sh[:, 1:] = GLOSS * _sheen(axes) * colors[:, None, :] + 0.01 * rng.normal(size=(n, 3, 3))
    return GaussianScene(
        means=np.concatenate([p.centres for p in parts]).astype(np.float32),
        scales=np.concatenate([p.scales for p in parts]).astype(np.float32),
        rotations=np.ascontiguousarray(quaternions, np.float32),
        opacities=np.full(n, OPACITY, np.float32),
        sh=sh,
        format="procedural",
    )


def _sheen(axes: FloatArray) -> FloatArray:
    """First-degree coefficients (N, 3, 1) that brighten a surface seen along its normal; SH order is -y, z, -x."""
    normal = axes[:, :, 2]
    return np.stack([normal[:, 1], -normal[:, 2], normal[:, 0]], axis=1)[:, :, None]
