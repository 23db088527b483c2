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
IndexArray = NDArray[np.intp]

PIXELS = TILE * TILE
ROUND_PAIRS = 16384  # pairs per round: large calls, so that two threads seldom wait for the interpreter lock
DEPTH_MAX = 32
GEMM_ROWS = 512  # OpenBLAS starts threads of its own only above M N K = 262144; 512 x 64 x 6 stays below
EXPONENT_MIN = -60.0  # far under 1/255; cv2.exp is slow where it underflows
LOG_ALPHA_MAX = float(np.log(np.float32(c.ALPHA_MAX)))
SKIP = float(np.nextafter(np.float32(c.ALPHA_MIN), np.float32(0)))  # cv2's test is "greater", ours "at least"
CHANNELS = 6  # r, g, b, 1, z - z0, (z - z0)^2
ROW = 16  # floats per table row: one cache line, so that a pair costs one miss
MX, MY, L1, L2, L3, LOG_OPACITY, XX, XY, YY, Z, FEATURES = range(11)


@dataclass(frozen=True)
class BandImage:
    """Sums over one band, (tiles, CHANNELS, PIXELS), and the depth z0 (tiles,) that its depths are relative to."""

    sums: Float32Array
    z0: Float32Array


def splat_table(splats: Splats) -> Float32Array:
    """The columns that blending gathers, one row per Gaussian (M + 1, ROW); the last row is transparent padding."""
    table = np.zeros((len(splats) + 1, ROW), np.float32)
    body, half = table[:-1], np.float32(-0.5)
    l1, l2, l3 = splats.l1, splats.l2, splats.l3
    columns = (splats.mx, splats.my, l1, l2, l3, splats.log_opacity)
    columns += (half * l1 * l1, -l1 * l2, half * (l2 * l2 + l3 * l3), splats.z, *splats.color)
    for i, column in enumerate(columns):
        body[:, i] = column
    body[:, FEATURES + 3] = 1
    table[-1, LOG_OPACITY] = 2 * EXPONENT_MIN
    return table


def pixel_basis() -> Float32Array:
    """(1, u, v, u^2, uv, v^2) of a tile's pixels, relative to its centre, (6, PIXELS), x fastest."""
    v, u = (a.ravel().astype(np.float32) + np.float32(0.5 - TILE / 2) for a in np.indices((TILE, TILE)))
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])


class Scratch:
    """Memory of one worker, kept between rounds and frames: fresh pages would cost more than the arithmetic."""

    def __init__(self, tiles: int = 0) -> None:
        self.pairs = max(ROUND_PAIRS, tiles)
        pairs = self.pairs + GEMM_ROWS
        self.rows = np.empty((pairs, ROW), np.float32)
        self.columns = np.empty(ROW * pairs, np.float32)
        self.coefficients = np.zeros((6, pairs), np.float32)
        self.work = np.empty((3, pairs), np.float32)
        self.weights = np.empty((pairs, PIXELS), np.float32)
        self.transmittance = np.empty((pairs + self.pairs) * PIXELS, np.float32)
        self.basis = pixel_basis()


def blend_band(
    table: Float32Array,
    lists: TileLists,
    centres: Float32Array,
    inside: Float32Array,
    scratch: Scratch,
    poll: Callable[[], None],
) -> BandImage:
    """Composite a band. centres (2, tiles): x, y of tile centres; inside (tiles, PIXELS): 1 where the pixel exists, else 0."""
    tiles = len(lists.count)
    image = BandImage(np.zeros((tiles, CHANNELS, PIXELS), np.float32), np.zeros(tiles, np.float32))
    live = np.flatnonzero(lists.count)
    image.z0[live] = table[lists.splats[lists.start[live]], Z]
    position, remaining = lists.start[live], lists.count[live]
    centre, z0, transmittance = centres[:, live], image.z0[live], inside[live]
    sums = np.zeros((len(live), CHANNELS, PIXELS), np.float32)
    while len(live):
        poll()
        depth = max(1, min(scratch.pairs // len(live), DEPTH_MAX, int(remaining.max())))
        g = _gather_index(lists.splats, position, remaining, depth, len(table) - 1)
        rows = _coefficients(table, g, centre, z0, scratch)
        weights = _alpha(g.shape, scratch)
        _composite(weights, transmittance, scratch)
        sums += np.matmul(rows.transpose(1, 2, 0)[:, FEATURES:, :], weights.transpose(1, 0, 2))
        position += depth
        remaining -= depth
        stay = (remaining > 0) & (transmittance.max(axis=1) > 0)
        if not stay.all():
            image.sums[live[~stay]] = sums[~stay]
            live, position, remaining, centre = live[stay], position[stay], remaining[stay], centre[:, stay]
            z0, transmittance, sums = z0[stay], transmittance[stay], sums[stay]
    return image


def _gather_index(
    splats: NDArray[np.int32], position: IndexArray, remaining: IndexArray, depth: int, pad: int
) -> NDArray[np.int32]:
    """Table rows of the next `depth` Gaussians of every live tile, (depth, tiles)."""
    level = np.arange(depth)[:, None]
    g = splats.take(position + level, mode="clip")
    if remaining.min() < depth:
        g[level >= remaining] = pad
    return g


def _coefficients(
    table: Float32Array, g: NDArray[np.int32], centre: Float32Array, z0: Float32Array, scratch: Scratch
) -> Float32Array:
    """Fills the exponents' coefficients of the pairs g (depth, tiles); returns their table rows with relative depths."""
    pairs = g.size
    rows = scratch.rows[:pairs]
    table.take(g.ravel(), axis=0, out=rows, mode="clip")
    columns = scratch.columns[: ROW * pairs].reshape(ROW, pairs)
    cv2.transpose(rows, columns)
    grid = columns.reshape(ROW, *g.shape)
    grid[MX] -= centre[0]
    grid[MY] -= centre[1]
    grid[Z] -= z0
    rows[:, FEATURES + 4] = columns[Z]
    np.square(columns[Z], out=rows[:, FEATURES + 5])
    mx, my, l1, l2, l3 = columns[:5]
    out = scratch.coefficients[:, :pairs]
    p, s, t = scratch.work[:, :pairs]
    np.multiply(l1, mx, out=p)
    np.multiply(l2, my, out=t)
    p += t
    np.multiply(l3, my, out=s)
    np.multiply(p, l1, out=out[1])
    np.multiply(p, l2, out=out[2])
    np.multiply(s, l3, out=t)
    out[2] += t
    np.square(p, out=p)
    np.square(s, out=s)
    p += s
    p *= np.float32(-0.5)
    np.add(p, columns[LOG_OPACITY], out=out[0])
    out[3:] = columns[XX : YY + 1]
    return rows.reshape(*g.shape, ROW)


def _alpha(shape: tuple[int, ...], scratch: Scratch) -> Float32Array:
    """Alpha of every pair at every pixel of its tile, (depth, tiles, PIXELS); 0 where under 1/255."""
    pairs = shape[0] * shape[1]
    padded = -(-pairs // GEMM_ROWS) * GEMM_ROWS
    blocks = scratch.coefficients[:, :padded].reshape(6, -1, GEMM_ROWS).transpose(1, 2, 0)
    np.matmul(blocks, scratch.basis, out=scratch.weights[:padded].reshape(-1, GEMM_ROWS, PIXELS))
    # one row: OpenCV splits work between its own threads by rows
    flat = scratch.weights[:pairs].reshape(1, -1)
    np.clip(flat, np.float32(EXPONENT_MIN), np.float32(LOG_ALPHA_MAX), out=flat)
    cv2.exp(flat, flat)
    cv2.threshold(flat, SKIP, 0, cv2.THRESH_TOZERO, flat)
    return flat.reshape(*shape, PIXELS)


def _composite(weights: Float32Array, transmittance: Float32Array, scratch: Scratch) -> None:
    """Alphas (depth, tiles, PIXELS) to blending weights, in place; pixels that end get transmittance 0.

    One small call per level, the rest in bulk: two threads that call often spend their time passing the interpreter lock.
    """
    depth = len(weights)
    before = scratch.transmittance[: (depth + 1) * transmittance.size].reshape(depth + 1, *transmittance.shape)
    np.subtract(np.float32(1), weights, out=weights)
    before[0] = transmittance
    for d, level in enumerate(weights):
        np.multiply(before[d], level, out=before[d + 1])
    after = before[1:].reshape(1, -1)
    cv2.threshold(after, c.TRANSMITTANCE_MIN, 0, cv2.THRESH_TOZERO, after)
    np.subtract(before[:-1], before[1:], out=weights)
    ended = np.flatnonzero((before[-1] == 0) & (transmittance > 0))
    if len(ended):
        # the Gaussian that would take a pixel below the limit does not count
        first = before[1:].reshape(depth, -1).take(ended, axis=1).argmin(axis=0)
        weights.reshape(depth, -1)[first, ended] = 0
    transmittance[:] = before[-1]
