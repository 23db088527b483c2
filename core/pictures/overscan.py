"""How much wider than a photo a straight picture has to be, to be bent into the photo without bare corners.

Both have the photo's number of pixels, so that they fit one render: the straight picture shows `overscan_ratio` times as much,
around the same middle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.camera import FloatArray, Intrinsics

# A lens model that folds over, or a very wide lens, would ask for a picture without end.
MOST = 2.0
EDGE_STEPS = 64
MARGIN_PX = 1.0  # for the neighbours between which a pixel is interpolated


def overscan_ratio(lens: Intrinsics) -> float:
    """Width of the straight picture over width of the photo, from 1 to MOST; 1 where the lens bends nothing outwards."""
    if not lens.has_distortion:
        return 1.0
    size = np.array([lens.width, lens.height], np.float64)
    away = np.abs(lens.undistort(_edge(size)) - size / 2) + MARGIN_PX
    needed = float((away / (size / 2)).max())
    return min(MOST, needed) if needed > 1 + 2 * MARGIN_PX / size.min() else 1.0


def overscanned(lens: Intrinsics, ratio: float) -> Intrinsics:
    """The pinhole of the straight picture: the photo's size in pixels, `ratio` times as much to see."""
    middle_x, middle_y = lens.width / 2, lens.height / 2
    return replace(
        lens.pinhole(),
        fx=lens.fx / ratio,
        fy=lens.fy / ratio,
        cx=middle_x + (lens.cx - middle_x) / ratio,
        cy=middle_y + (lens.cy - middle_y) / ratio,
    )


def _edge(size: FloatArray) -> FloatArray:
    """Points (N, 2) along the outer edge of a picture."""
    along = np.linspace(0, 1, EDGE_STEPS + 1)
    zero, one = np.zeros_like(along), np.ones_like(along)
    sides = [(along, zero), (along, one), (zero, along), (one, along)]
    return np.concatenate([np.stack(side, axis=1) for side in sides]) * size
