"""Front-to-back compositing of a batch of tiles: all live tiles in lockstep, some Gaussians deep at a time.

The exponent of a (Gaussian, tile) pair is linear in (1, u, v, u^2, uv, v^2) of the pixel, so a round's exponents are one
matrix product; so are the sums over depth of weight times (colour, 1, depth).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.conventions import HALF_PIXEL
from . import constants as c
from .columns import BLEND_COLUMNS, BlendColumn
from .project import TILE
from .tiles import TileLists

Float32Array = NDArray[np.float32]
IndexArray = NDArray[np.intp]

PIXELS = TILE * TILE
ROUND_PAIRS = (
    8192  # pairs per round: two buffers of 2 MB; larger calls pass the interpreter lock less often but leave the cache
)
# Pairs of splat and tile whose parameters are gathered at once, for several rounds.
SEGMENT_PAIRS = 49152
# Most levels of a round. Tiles turn opaque meanwhile, and a byte counts the levels before a pixel ends.
DEPTH_MAX = 255
# OpenBLAS starts threads of its own only above M N K = 262144, and 512 x 64 x 6 stays below that.
GEMM_ROWS = 512
# Far below 1/255. The bound is there because cv2.exp is slow where it underflows.
EXPONENT_MIN = -60.0
LOG_ALPHA_MAX = float(np.log(np.float32(c.ALPHA_MAX)))
# OpenCV's threshold keeps what is greater, and the rule here is "at least", hence the next smaller number.
SKIP = float(np.nextafter(np.float32(c.ALPHA_MIN), np.float32(0)))
# Red, green, blue, 1, z - z0 and (z - z0)^2.
CHANNELS = 6


@dataclass(frozen=True, eq=False)
class TileImage:
    """Sums over each tile's Gaussians, (tiles, CHANNELS, PIXELS), and the depth z0 (tiles,) that its depths are relative to."""

    sums: Float32Array
    z0: Float32Array


@dataclass(frozen=True, eq=False)
class BlendWork:
    """What all batches of tiles share: the splats' table, the tiles' lists, the image that they go into, and what is called
    often and may raise to stop the work.
    """

    table: Float32Array
    lists: TileLists
    image: TileImage
    poll: Callable[[], None]


@dataclass(frozen=True, eq=False)
class TileBatch:
    """At most ROUND_PAIRS tiles, none of whose lists is empty. tiles (n,): their numbers in the lists; centre (2, n): x, y of
    their centres; inside (n, PIXELS): 1 where the pixel exists, else 0.
    """

    tiles: IndexArray
    centre: Float32Array
    inside: Float32Array


@dataclass(frozen=True, eq=False)
class PairSegment:
    """The parameters of the next pairs of every tile: rows (depth, n, BLEND_COLUMNS) of the table with relative depths, and the
    coefficients (6, pairs and padding) of their exponents.
    """

    rows: Float32Array
    coefficients: Float32Array


def pixel_basis() -> Float32Array:
    """(1, u^2, uv, v^2, 2u, 2v) of a tile's pixels, relative to its centre, (6, PIXELS), x fastest."""
    v, u = (a.ravel().astype(np.float32) + np.float32(HALF_PIXEL - TILE / 2) for a in np.indices((TILE, TILE)))
    return np.stack([np.ones_like(u), u * u, u * v, v * v, 2 * u, 2 * v])


class Scratch:
    """Memory of one worker, kept between rounds and frames: fresh pages would cost more than the arithmetic."""

    def __init__(self) -> None:
        pairs = SEGMENT_PAIRS + GEMM_ROWS
        self.rows = np.empty((pairs, BLEND_COLUMNS), np.float32)
        self.columns = np.empty(BLEND_COLUMNS * pairs, np.float32)
        self.work = np.empty(3 * pairs, np.float32)
        self.weights = np.empty((ROUND_PAIRS + GEMM_ROWS, PIXELS), np.float32)
        self.transmittance = np.empty(2 * ROUND_PAIRS * PIXELS, np.float32)
        self.basis = pixel_basis()
        self.chained = _multiplies_in_order(self.transmittance)


def blend_tiles(work: BlendWork, batch: TileBatch, scratch: Scratch) -> None:
    """Composites the tiles of a batch into the image."""
    table, lists, image = work.table, work.lists, work.image
    live, transmittance = batch.tiles, batch.inside
    # The next entry of each tile's list, and how many entries are left.
    state = np.stack([lists.start[live], lists.count[live]])
    z0 = image.z0[live] = table[lists.splats[state[0]], BlendColumn.Z]
    offset = np.concatenate([batch.centre, z0[None]])
    sums = np.zeros((len(live), CHANNELS, PIXELS), np.float32)
    while len(live):
        depth = max(1, min(SEGMENT_PAIRS // len(live), int(state[1].max())))
        g = _gather_index(lists.splats, state, depth, len(table) - 1)
        segment = _coefficients(table, g, offset, scratch)
        done, seeing, transmittance = _blend_segment(segment, transmittance, sums, scratch, work.poll)
        state += ((done,), (-done,))
        stay = (state[1] > 0) & seeing
        if not stay.all():
            image.sums[live[~stay]] = sums[~stay]
            live, state, offset = live[stay], state[:, stay], offset[:, stay]
            transmittance, sums = transmittance[stay], sums[stay]


def _blend_segment(
    segment: PairSegment,
    transmittance: Float32Array,
    sums: Float32Array,
    scratch: Scratch,
    poll: Callable[[], None],
) -> tuple[int, NDArray[np.bool_], Float32Array]:
    """Adds the pairs of one segment, round by round, until half of its tiles are opaque.

    Returns the levels that were added, which tiles (n,) are not opaque yet and the transmittance (n, PIXELS) that is left, in
    the scratch. `transmittance` (n, PIXELS) is that of before; `sums` (n, CHANNELS, PIXELS) are updated.
    """
    rows, coefficients = segment.rows, segment.coefficients
    depth, tiles, _ = rows.shape
    step = max(1, min(ROUND_PAIRS // tiles, DEPTH_MAX))
    alive = transmittance.ravel() > 0
    for begin in range(0, depth, step):
        poll()
        end = min(begin + step, depth)
        weights = _alpha(coefficients[:, begin * tiles :], (end - begin, tiles), scratch)
        transmittance, alive = _composite(weights, transmittance, alive, scratch)
        sums += np.matmul(rows[begin:end].transpose(1, 2, 0)[:, BlendColumn.FEATURES :, :], weights.transpose(1, 0, 2))
        # Half of the tiles can be opaque only where half of the pixels have ended; the cheaper test comes first.
        if 2 * np.count_nonzero(alive) < alive.size and 2 * np.count_nonzero(_seeing(alive)) < tiles:
            break
    return end, _seeing(alive), transmittance


def _seeing(alive: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which tiles (n,) have a pixel that has not ended; alive (n * PIXELS,)."""
    return alive.view(np.uint64).reshape(-1, PIXELS // 8).any(axis=1)


def _gather_index(splats: NDArray[np.int32], state: IndexArray, depth: int, pad: int) -> NDArray[np.int32]:
    """Table rows of the next `depth` Gaussians of every live tile, (depth, tiles)."""
    level = np.arange(depth)[:, None]
    g: NDArray[np.int32] = splats.take(state[0] + level, mode="clip")
    if state[1].min() < depth:
        g[level >= state[1]] = pad
    return g


def _coefficients(table: Float32Array, g: NDArray[np.int32], offset: Float32Array, scratch: Scratch) -> PairSegment:
    """The parameters of the pairs whose table rows are g (depth, tiles). offset (3, tiles): what x, y and z are relative to."""
    pairs = g.size
    # The matrix product of a round reads up to one block beyond its pairs.
    padded = pairs + GEMM_ROWS
    rows = scratch.rows[:pairs]
    table.take(g.ravel(), axis=0, out=rows, mode="clip")
    columns = scratch.columns[: BLEND_COLUMNS * padded].reshape(BLEND_COLUMNS, padded)
    cv2.transpose(rows[:, : BlendColumn.FEATURES], columns[: BlendColumn.FEATURES, :pairs])
    columns[: BlendColumn.FEATURES, pairs:] = 0
    relative = columns[: BlendColumn.L1, :pairs].reshape(BlendColumn.L1, *g.shape)
    relative -= offset[:, None]
    rows[:, BlendColumn.FEATURES + 4] = columns[BlendColumn.Z, :pairs]
    np.square(columns[BlendColumn.Z, :pairs], out=rows[:, BlendColumn.FEATURES + 5])
    work = scratch.work[: 3 * padded].reshape(3, padded)
    p, t, s = work
    l3, linear = columns[BlendColumn.L3], columns[BlendColumn.FEATURES : BlendColumn.FEATURES + 2]
    np.multiply(columns[BlendColumn.X : BlendColumn.Y + 1], columns[BlendColumn.L1 : BlendColumn.L2 + 1], out=work[:2])
    np.multiply(columns[BlendColumn.Y], l3, out=s)
    p += t
    np.multiply(columns[BlendColumn.L1 : BlendColumn.L2 + 1], p, out=linear)
    np.multiply(s, l3, out=t)
    linear[1] += t
    np.square(work, out=work)
    columns[BlendColumn.LOG_OPACITY] -= p
    columns[BlendColumn.LOG_OPACITY] -= s
    return PairSegment(rows.reshape(*g.shape, BLEND_COLUMNS), columns[BlendColumn.LOG_OPACITY : BlendColumn.FEATURES + 2])


def _alpha(coefficients: Float32Array, shape: tuple[int, ...], scratch: Scratch) -> Float32Array:
    """Alpha of every pair at every pixel of its tile, (depth, tiles, PIXELS); 0 where under 1/255."""
    pairs = shape[0] * shape[1]
    padded = -(-pairs // GEMM_ROWS) * GEMM_ROWS
    blocks = coefficients[:, :padded].reshape(6, -1, GEMM_ROWS).transpose(1, 2, 0)
    np.matmul(blocks, scratch.basis, out=scratch.weights[:padded].reshape(-1, GEMM_ROWS, PIXELS))
    # The array has one row, because OpenCV shares rows among threads of its own.
    flat = scratch.weights[:pairs].reshape(1, -1)
    np.clip(flat, np.float32(EXPONENT_MIN), np.float32(LOG_ALPHA_MAX), out=flat)
    cv2.exp(flat, flat)
    cv2.threshold(flat, SKIP, 0, cv2.THRESH_TOZERO, flat)
    return flat.reshape(*shape, PIXELS)


def _composite(
    weights: Float32Array, transmittance: Float32Array, alive: NDArray[np.bool_], scratch: Scratch
) -> tuple[Float32Array, NDArray[np.bool_]]:
    """Alphas (depth, tiles, PIXELS) to blending weights, in place.

    Returns the transmittance (tiles, PIXELS), in the scratch, that the levels leave over, 0 for pixels that have ended, and
    where it is not 0, (tiles * PIXELS,); `alive` is that of before.
    """
    depth = len(weights)
    before = scratch.transmittance[: (depth + 1) * transmittance.size].reshape(depth + 1, -1)
    passed = weights.reshape(depth, -1)
    np.subtract(np.float32(1), passed, out=passed)
    before[0] = transmittance.ravel()
    _chain(passed, before, scratch.chained)
    after = before[1:].reshape(1, -1)
    cv2.threshold(after, c.TRANSMITTANCE_MIN, 0, cv2.THRESH_TOZERO, after)
    np.subtract(before[:-1], before[1:], out=passed)
    still = before[-1] > 0
    ended = np.flatnonzero(alive > still)
    if len(ended):
        # The Gaussian that would take a pixel below the limit does not count.
        first = (before[1:].take(ended, axis=1) > 0).view(np.uint8).sum(axis=0, dtype=np.uint8)
        passed[first, ended] = 0
    return before[-1].reshape(transmittance.shape), still


def _chain(passed: Float32Array, before: Float32Array, at_once: bool) -> None:
    """before[d + 1] = before[d] * passed[d] down the levels, before[0] given; passed (depth, n), before (depth + 1, n).

    At once, source and result overlap, shifted by a level (numpy would work on a copy): OpenCV goes through them in the order
    of memory, so that each level finds the one before it done. A call per level would be some thousand more per frame, and
    threads that make short calls spend their time passing the interpreter lock.
    """
    if at_once:
        cv2.multiply(before[:-1], passed, before[1:])
    else:
        for d in range(len(passed)):
            np.multiply(before[d], passed[d], out=before[d + 1])


def _multiplies_in_order(room: Float32Array) -> bool:
    """Whether this OpenCV chains levels at once, tried on few long levels and on many short ones; room (n,) is overwritten."""
    for depth, n in ((3, len(room) // 4), (DEPTH_MAX // 3, PIXELS)):
        before = room[: (depth + 1) * n].reshape(depth + 1, n)
        before[0], before[1:] = 1, np.nan
        _chain(np.full((depth, n), 0.5, np.float32), before, at_once=True)
        if not (before == np.exp2(-np.arange(depth + 1, dtype=np.float32))[:, None]).all():
            return False
    return True
