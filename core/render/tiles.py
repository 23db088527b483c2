"""Which Gaussian touches which tile: exact ellipse-tile test, lists in depth order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .project import Splats

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

TILE = 8  # pixels along each side of a tile
BATCH_PAIRS = 49152  # pairs of a batch: some twenty batches in a photo, so that two threads end together
TILE_COST = 8  # what a tile counts at least, in pairs; bounds the tiles of a batch


@dataclass(frozen=True)
class TileLists:
    """Tiles of one band of the image. Tile i (row-major) lists splats[start[i] : start[i] + count[i]], front to back."""

    splats: Int32Array
    start: NDArray[np.intp]
    count: NDArray[np.intp]


def bin_band(splats: Splats, columns: int, row_begin: int, row_end: int) -> TileLists:
    """Tile lists of the tile rows [row_begin, row_end) of an image `columns` tiles wide."""
    lo = np.floor((splats.my - splats.ey - np.float32(0.5)) * np.float32(1 / TILE))
    hi = np.floor((splats.my + splats.ey - np.float32(0.5)) * np.float32(1 / TILE))
    index = np.flatnonzero((hi >= row_begin) & (lo < row_end))
    first = np.maximum(lo.take(index), row_begin).astype(np.int32)
    rows = np.minimum(hi.take(index), row_end - 1).astype(np.int32) - first + 1
    g, row = _expand(index.astype(np.int32), first, rows)
    begin, length = _span(splats, g, row, columns)
    base = (row - np.int32(row_begin)) * np.int32(columns) + begin
    listed, tile = _expand(g, base, length)
    tiles = columns * (row_end - row_begin)
    order = np.argsort(tile.astype(np.uint16), kind="stable")
    count = np.bincount(tile, minlength=tiles)
    return TileLists(listed.take(order), np.cumsum(count) - count, count)


def join_bands(bands: Sequence[TileLists]) -> TileLists:
    """One list of the tiles of several bands, in their order."""
    offset = np.cumsum([0] + [len(b.splats) for b in bands])
    start = np.concatenate([b.start + o for b, o in zip(bands, offset[:-1], strict=True)])
    return TileLists(np.concatenate([b.splats for b in bands]), start, np.concatenate([b.count for b in bands]))


def plan_batches(count: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """The tiles that list anything, in batches of about BATCH_PAIRS pairs, longest lists first.

    Lists of one length fill a batch's rounds evenly, and the workers that share the batches end together.
    """
    order = np.argsort(-count, kind="stable")[: np.count_nonzero(count)]
    batch = (np.cumsum(np.maximum(count[order], TILE_COST)) - 1) // BATCH_PAIRS
    return np.split(order, np.flatnonzero(np.diff(batch)) + 1) if len(order) else []


def _expand(values: Int32Array, first: Int32Array, counts: Int32Array) -> tuple[Int32Array, Int32Array]:
    """Each value repeated `counts` times, beside the running number first, first + 1, ..."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    shift = first - (ends - counts).astype(np.int32)
    source = np.repeat(np.arange(len(values)), counts)
    running = shift.take(source)
    running += np.arange(total, dtype=np.int32)
    return values.take(source), running


def _span(splats: Splats, g: Int32Array, row: Int32Array, columns: int) -> tuple[Int32Array, Int32Array]:
    """First tile column and number of columns that the ellipse of splat g covers within tile row `row`."""
    my, tilt = splats.my.take(g), splats.tilt.take(g)
    top = row.astype(np.float32) * np.float32(TILE) + np.float32(0.5) - my
    bottom = top + np.float32(TILE - 1)
    skew, l3, cut = splats.skew.take(g), splats.l3.take(g), splats.cut.take(g)
    inverse, mx = np.float32(1) / splats.l1.take(g), splats.mx.take(g) - np.float32(0.5)

    def edge(dy: Float32Array, sign: int) -> Float32Array:
        # q = (l1 dx + l2 dy)^2 + (l3 dy)^2 <= cut at this dy; the ellipse is convex, so its extreme over the row is here
        half = np.sqrt(np.maximum(cut - np.square(l3 * dy), np.float32(0))) * inverse
        return np.asarray(np.floor((mx - skew * dy + sign * half) * np.float32(1 / TILE)))

    begin = np.clip(edge(np.clip(-tilt, top, bottom), -1), 0, columns).astype(np.int32)
    end = np.clip(edge(np.clip(tilt, top, bottom), 1), -1, columns - 1).astype(np.int32)
    return begin, np.asarray(np.maximum(end - begin + np.int32(1), np.int32(0)))
