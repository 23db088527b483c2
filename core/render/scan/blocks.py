"""The tables in blocks of neighbours: blocks outside of a view are left out before any of their Gaussians is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.intp]

# Gaussians in a block. In a scan of 120,000 that is seen from inside, blocks of 256 leave half as much to look at as do those
# of 1024.
BLOCK = 256
# The share of a bound by which rounding in float32 may move a Gaussian across it.
ROUNDING = 1e-5


@dataclass(frozen=True, eq=False)
class SceneBlocks:
    """Boxes around the means of each BLOCK Gaussians, relative to the tables' origin: middle (3, B), half their sides (3, B),
    scene units; reach (B,): the greatest of the Gaussians in it. The last block may be shorter; count: all Gaussians.
    """

    middle: FloatArray
    half: FloatArray
    reach: FloatArray
    count: int

    @classmethod
    def of(cls, means: NDArray[np.float32], reach: NDArray[np.float32]) -> SceneBlocks:
        """means (3, N), reach (N,)."""
        count = means.shape[1]
        starts = np.arange(0, count, BLOCK)
        if not count:
            return cls(np.zeros((3, 0)), np.zeros((3, 0)), np.zeros(0), 0)
        low, high = (f.reduceat(means, starts, axis=1).astype(np.float64) for f in (np.minimum, np.maximum))
        greatest = np.maximum.reduceat(reach, starts).astype(np.float64)
        return cls((low + high) / 2, (high - low) / 2, greatest, count)

    def __len__(self) -> int:
        return len(self.reach)

    def least(self, functional: FloatArray, offset: float) -> FloatArray:
        """The least value (B,) that `functional` (3,), in the world's axes, plus `offset` takes in each box."""
        middle = functional @ self.middle + offset
        spread = np.abs(functional) @ self.half
        slack = ROUNDING * (np.abs(functional) @ np.abs(self.middle) + spread + abs(offset))
        return np.asarray(middle - spread - slack)


@dataclass(frozen=True, eq=False)
class Part:
    """Some blocks of the tables, one item of work. runs: slices of the tables, ascending; slots: the room for what a view shows
    of them.
    """

    runs: Sequence[slice]
    slots: slice

    def columns(self, rows: NDArray[Any]) -> NDArray[Any]:
        """The columns of the runs out of `rows` (..., N); of a single run without a copy."""
        if len(self.runs) == 1:
            return np.asarray(rows[..., self.runs[0]])
        return np.concatenate([rows[..., run] for run in self.runs], axis=-1)

    def places(self, index: IndexArray) -> IndexArray:
        """Where in the tables the columns `index` of this part stand."""
        if len(self.runs) == 1:
            return np.asarray(index + self.runs[0].start)
        ends = np.cumsum([run.stop - run.start for run in self.runs])
        first = np.array([run.stop for run in self.runs]) - ends
        return np.asarray(index + first.take(np.searchsorted(ends, index, side="right")))


def parts_of(blocks: IndexArray, count: int, most: int) -> list[Part]:
    """The `blocks` (ascending) of `count` Gaussians in an even number of parts alike, so that two threads end together; each of
    `most` Gaussians or few more.
    """
    parts, slot = [], 0
    for some in np.array_split(blocks, 2 * max(1, -(-len(blocks) * BLOCK // (2 * most)))):
        if len(some):
            breaks = np.flatnonzero(np.diff(some) > 1) + 1
            runs = [slice(int(r[0]) * BLOCK, min((int(r[-1]) + 1) * BLOCK, count)) for r in np.split(some, breaks)]
            size = sum(run.stop - run.start for run in runs)
            parts.append(Part(runs, slice(slot, slot + size)))
            slot += size
    return parts
