"""Front-to-back compositing of one band of tiles: all live tiles in lockstep, some Gaussians deep at a time.

The exponent of a (Gaussian, tile) pair is linear in (1, u, v, u^2, uv, v^2) of the pixel, so a round's exponents are one
matrix product; so are the sums over depth of weight times (colour, 1, depth).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from . import constants as c
from .project import Splats
from .tiles import TILE, TileLists

Float32Array = NDArray[np.float32]

PIXELS = TILE * TILE
ROUND_PAIRS = 8192  # pairs per round: the weights of a round (2 MiB) stay near the core
DEPTH_MIN, DEPTH_MAX = 8, 64
GEMM_ROWS = 512  # OpenBLAS starts threads of its own only above M N K = 262144; 512 x 64 x 6 stays below
EXPONENT_MIN = -60.0  # far under 1/255, and cv2.exp is slow where it underflows
LOG_ALPHA_MAX = float(np.log(np.float32(c.ALPHA_MAX)))
SKIP = float(np.nextafter(np.float32(c.ALPHA_MIN), np.float32(0)))  # cv2's test is "greater", ours "at least"
CHANNELS = 6  # r, g, b, 1, z - z0, (z - z0)^2


@dataclass(frozen=True)
class BandImage:
    """Sums over one band, (tiles, CHANNELS, PIXELS), and the depth z0 (tiles,) that its depths are relative to."""

    sums: Float32Array
    z0: Float32Array


class SplatTable:
    """The columns that blending gathers, with one more, fully transparent Gaussian at the end as padding."""

    def __init__(self, splats: Splats) -> None:
        l1, l2, l3 = splats.l1, splats.l2, splats.l3
        half = np.float32(-0.5)
        shape = (splats.mx, splats.my, l1, l2, l3, splats.log_opacity, half * l1 * l1, -l1 * l2, half * (l2 * l2 + l3 * l3))
        self.shape = [_padded(a) for a in shape]
        self.shape[5][-1] = 2 * EXPONENT_MIN
        self.features = [_padded(a) for a in (*splats.color, splats.z)]
        self.pad = len(splats)


def _padded(column: Float32Array) -> Float32Array:
    return np.append(column, np.float32(0.0))


def pixel_basis() -> Float32Array:
    """(1, u, v, u^2, uv, v^2) of a tile's pixels, relative to its centre, (6, PIXELS), x fastest."""
    v, u = (a.ravel().astype(np.float32) + np.float32(0.5 - TILE / 2) for a in np.indices((TILE, TILE)))
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])


def blend_band(
    table: SplatTable,
    lists: TileLists,
    centre_x: Float32Array,
    centre_y: Float32Array,
    inside: Float32Array,
    poll: Callable[[], None],
) -> BandImage:
    """Composite a band. centre_x, centre_y (tiles,): tile centres; inside (tiles, PIXELS): 1 where the pixel exists, else 0."""
    tiles = len(lists.count)
    image = BandImage(np.zeros((tiles, CHANNELS, PIXELS), np.float32), np.zeros(tiles, np.float32))
    live = np.flatnonzero(lists.count)
    image.z0[live] = table.features[3][lists.splats[lists.start[live]]]
    transmittance = inside[live]
    done = 0
    while len(live):
        poll()
        remaining = lists.count[live] - done
        depth = int(np.clip(ROUND_PAIRS // len(live), DEPTH_MIN, min(DEPTH_MAX, remaining.max())))
        position = lists.start[live] + done + np.arange(depth)[:, None]
        exists = np.arange(depth)[:, None] < remaining
        g = np.where(exists, lists.splats[np.where(exists, position, 0)], table.pad)
        weights = _alpha(table, g, centre_x[live], centre_y[live])
        _composite(weights, transmittance)
        image.sums[live] += np.matmul(_features(table, g, image.z0[live]), weights.transpose(1, 0, 2))
        done += depth
        stay = (remaining > depth) & (transmittance.max(axis=1) > 0)
        live, transmittance = live[stay], transmittance[stay]
    return image


def _alpha(table: SplatTable, g: NDArray[np.integer], centre_x: Float32Array, centre_y: Float32Array) -> Float32Array:
    """Alpha of every pair (depth, tiles) at every pixel of its tile, (depth, tiles, PIXELS); 0 where under 1/255."""
    mx, my, l1, l2, l3, log_opacity, xx, xy, yy = (column[g] for column in table.shape)
    mx -= centre_x
    my -= centre_y
    p, s = l1 * mx + l2 * my, l3 * my
    pairs = g.size
    coefficients = np.zeros((-(-pairs // GEMM_ROWS) * GEMM_ROWS, 6), np.float32)
    for i, column in enumerate((log_opacity - np.float32(0.5) * (p * p + s * s), p * l1, p * l2 + s * l3, xx, xy, yy)):
        coefficients[:pairs, i] = column.ravel()
    exponent = np.matmul(coefficients.reshape(-1, GEMM_ROWS, 6), pixel_basis()).reshape(1, -1)
    np.clip(exponent, np.float32(EXPONENT_MIN), np.float32(LOG_ALPHA_MAX), out=exponent)
    cv2.exp(exponent, exponent)
    cv2.threshold(exponent, SKIP, 0, cv2.THRESH_TOZERO, exponent)
    return exponent[0, : pairs * PIXELS].reshape(*g.shape, PIXELS)


def _composite(weights: Float32Array, transmittance: Float32Array) -> None:
    """Alphas (depth, tiles, PIXELS) to blending weights, in place; pixels that end get transmittance 0."""
    before = transmittance.copy()
    for level in weights:
        np.multiply(level, transmittance, out=level)
        np.subtract(transmittance, level, out=transmittance)
    ended = np.flatnonzero((transmittance < np.float32(c.TRANSMITTANCE_MIN)) & (before > 0))
    if len(ended):
        flat = weights.reshape(len(weights), -1)
        w = flat[:, ended]
        after = before.ravel()[ended] - np.matmul(np.tri(len(w), dtype=np.float32), w)
        w *= after >= np.float32(c.TRANSMITTANCE_MIN)
        flat[:, ended] = w
        transmittance.ravel()[ended] = 0


def _features(table: SplatTable, g: NDArray[np.integer], z0: Float32Array) -> Float32Array:
    """(tiles, CHANNELS, depth) factors of the weights."""
    out = np.empty((CHANNELS, g.shape[1], g.shape[0]), np.float32)
    gt = g.T
    for i in range(3):
        out[i] = table.features[i][gt]
    out[3] = 1
    np.subtract(table.features[3][gt], z0[:, None], out=out[4])
    np.multiply(out[4], out[4], out=out[5])
    return out.transpose(1, 0, 2)
