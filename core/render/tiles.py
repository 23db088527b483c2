"""Which Gaussian touches which tile: exact ellipse-tile test, lists in depth order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .columns import ELLIPSE_COLUMNS, EllipseColumn
from .project import TILE, SplatBuffers

Float32Array = NDArray[np.float32]
Int16Array = NDArray[np.int16]
Int32Array = NDArray[np.int32]
Int64Array = NDArray[np.int64]
IndexArray = NDArray[np.intp]

# Pairs of a batch. A photo has some twenty batches, so that two threads end together.
BATCH_PAIRS = 49152
# So many pairs at the end of a frame come in batches of a quarter of the size.
LAST_PAIRS = 2 * BATCH_PAIRS
# A tile counts as at least so many pairs, which bounds the number of tiles in a batch.
TILE_COST = 8


@dataclass(frozen=True, eq=False)
class TileLists:
    """Tiles of one band of the image. Tile i (row-major) lists splats[start[i] : start[i] + count[i]], front to back."""

    splats: Int32Array
    start: NDArray[np.intp]
    count: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Order:
    """The M splats to draw, front to back: slots (M,) and their first and last tile rows (M,)."""

    slots: IndexArray
    first: Int16Array
    last: Int16Array

    @classmethod
    def of(cls, splats: SplatBuffers, slots: IndexArray) -> Order:
        return cls(slots, splats.first.take(slots), splats.last.take(slots))


def bin_band(splats: SplatBuffers, order: Order, columns: int, row_begin: int, row_end: int) -> TileLists:
    """Tile lists of the tile rows [row_begin, row_end) of an image `columns` tiles wide."""
    hit = np.flatnonzero((order.last >= row_begin) & (order.first < row_end))
    first, rows = np.maximum(order.first.take(hit), row_begin), np.minimum(order.last.take(hit), row_end - 1)
    rows -= first
    rows += 1
    spans = _expand(_pack(order.slots.take(hit), first), rows)
    row = spans.astype(np.int32)
    slots = np.right_shift(spans, 32, out=spans)
    begin, length = _span(splats.ellipses.take(slots, axis=0), row, columns)
    row -= row_begin
    row *= columns
    row += begin
    some = np.flatnonzero(length > 0)
    pairs = _expand(_pack(slots, row).take(some), length.take(some))
    tile = pairs.astype(np.uint16)
    by_tile = np.argsort(tile, kind="stable")
    starts = np.searchsorted(tile.take(by_tile), np.arange(columns * (row_end - row_begin) + 1, dtype=np.uint16))
    listed = np.right_shift(pairs, 32, out=pairs).take(by_tile)
    return TileLists(listed.astype(np.int32), starts[:-1], np.diff(starts))


def join_bands(bands: Sequence[TileLists]) -> TileLists:
    """One list of the tiles of several bands, in their order."""
    offset = np.cumsum([0] + [len(b.splats) for b in bands])
    start = np.concatenate([b.start + o for b, o in zip(bands, offset[:-1], strict=True)])
    return TileLists(np.concatenate([b.splats for b in bands]), start, np.concatenate([b.count for b in bands]))


def plan_batches(count: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """The tiles that list anything, in batches of about BATCH_PAIRS pairs, longest lists first, less in the last ones.

    Lists of one length fill a batch's rounds evenly; small last batches let the workers that share them end together.
    """
    order = np.argsort(-count, kind="stable")[: np.count_nonzero(count)]
    if not len(order):
        return []
    pairs = np.cumsum(np.maximum(count[order], TILE_COST)) - 1
    late = max(0, int(pairs[-1]) - LAST_PAIRS)
    batch = pairs // BATCH_PAIRS + np.maximum(pairs - late, 0) // (BATCH_PAIRS // 4)
    return np.split(order, np.flatnonzero(np.diff(batch)) + 1)


def _pack(high: IndexArray, low: Int16Array | Int32Array) -> Int64Array:
    """Packs two numbers of 32 bits into one of 64; low >= 0."""
    out = np.left_shift(high, 32, dtype=np.int64)
    out |= low
    return out


def _expand(values: Int64Array, counts: Int16Array | Int32Array) -> Int64Array:
    """value, value + 1, ... for each value (n,), `counts` (n,) >= 1 times.

    A running sum over ones with a jump where the next value begins: np.repeat takes seven times as long and keeps the
    interpreter lock.
    """
    ends = np.cumsum(counts, dtype=np.intp)
    out = np.ones(ends[-1] if len(ends) else 0, np.int64)
    if len(out):
        jump = np.diff(values)
        jump -= counts[:-1]
        jump += 1
        out[0] = values[0]
        out[ends[:-1]] = jump
        np.cumsum(out, out=out)
    return out


def _span(ellipses: Float32Array, row: Int32Array, columns: int) -> tuple[Int32Array, Int32Array]:
    """First tile column and number of columns (n,), at most 0 for none, that an ellipse covers within a tile row.

    ellipses (n, ELLIPSE_COLUMNS): rows of `SplatBuffers.ellipses`; row (n,).
    """
    s = np.empty((ELLIPSE_COLUMNS, len(row)), np.float32)
    if len(row):
        cv2.transpose(ellipses, s)
    top = row * np.float32(TILE)
    top -= s[EllipseColumn.Y]
    # The rows at which the ellipse reaches furthest left and right, or the nearest rows to them within the tile.
    dy = s[EllipseColumn.TILT] * np.array([[-1], [1]], np.float32)
    np.clip(dy, top, top + np.float32(TILE - 1), out=dy)
    # At this dy, q = (l1 dx + l2 dy)^2 + (l3 dy)^2 <= cut. The ellipse is convex, so that its extreme within the row is here.
    half = dy * s[EllipseColumn.L3]
    np.square(half, out=half)
    np.subtract(s[EllipseColumn.CUT], half, out=half)
    np.maximum(half, np.float32(0), out=half)
    np.sqrt(half, out=half)
    half *= s[EllipseColumn.INVERSE_L1]
    dy *= s[EllipseColumn.SKEW]
    np.subtract(s[EllipseColumn.X], dy, out=dy)
    dy[0] -= half[0]
    dy[1] += half[1]
    np.floor(dy, out=dy)
    np.clip(dy, np.array([[0], [-1]], np.float32), np.array([[columns], [columns - 1]], np.float32), out=dy)
    begin, length = dy.astype(np.int32)
    length -= begin
    length += 1
    return begin, length
