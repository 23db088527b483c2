"""Which Gaussian touches which tile: exact ellipse-tile test, lists in depth order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .project import Splats

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]

TILE = 8  # pixels along each side of a tile


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
    first = np.maximum(lo[index], row_begin).astype(np.int32)
    rows = np.minimum(hi[index], row_end - 1).astype(np.int32) - first + 1
    g, row = _expand(index.astype(np.int32), first, rows)
    begin, length = _span(splats, g, row, columns)
    base = (row - np.int32(row_begin)) * np.int32(columns) + begin
    listed, tile = _expand(g, base, length)
    tiles = columns * (row_end - row_begin)
    order = np.argsort(tile.astype(np.uint16), kind="stable")
    count = np.bincount(tile, minlength=tiles)
    return TileLists(listed[order], np.cumsum(count) - count, count)


def _expand(values: Int32Array, first: Int32Array, counts: Int32Array) -> tuple[Int32Array, Int32Array]:
    """Each value repeated `counts` times, beside the running number first, first + 1, ..."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    shift = first - (ends - counts).astype(np.int32)
    running = np.repeat(shift, counts)
    running += np.arange(total, dtype=np.int32)
    return np.repeat(values, counts), running


def _span(splats: Splats, g: Int32Array, row: Int32Array, columns: int) -> tuple[Int32Array, Int32Array]:
    """First tile column and number of columns that the ellipse of splat g covers within tile row `row`."""
    my, tilt = splats.my[g], splats.tilt[g]
    top = row.astype(np.float32) * np.float32(TILE) + np.float32(0.5) - my
    bottom = top + np.float32(TILE - 1)
    skew, l3, cut = splats.skew[g], splats.l3[g], splats.cut[g]
    inverse, mx = np.float32(1) / splats.l1[g], splats.mx[g] - np.float32(0.5)

    def edge(dy: Float32Array, sign: int) -> Float32Array:
        # q = (l1 dx + l2 dy)^2 + (l3 dy)^2 <= cut at this dy; the ellipse is convex, so its extreme over the row is here
        half = np.sqrt(np.maximum(cut - np.square(l3 * dy), np.float32(0))) * inverse
        return np.asarray(np.floor((mx - skew * dy + sign * half) * np.float32(1 / TILE)))

    begin = np.clip(edge(np.clip(-tilt, top, bottom), -1), 0, columns).astype(np.int32)
    end = np.clip(edge(np.clip(tilt, top, bottom), 1), -1, columns - 1).astype(np.int32)
    return begin, np.asarray(np.maximum(end - begin + np.int32(1), np.int32(0)))
