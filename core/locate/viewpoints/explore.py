"""Which views are worth a place in the map: cheap looks at many, and a greedy choice by what stays in place between two eyes.

A splat looks right only from about where it was photographed. There, features of two renders side by side match and their
lifted points agree; behind a wall or among floaters they do not. Views are chosen for the stable points that few views before
them have shown, and new candidates are looked for around those that were chosen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...geometry.lie import so3_exp
from .candidates import Viewpoint
from .scout import Scout, Sight

FIRST_LOOKS = 12
FRUITLESS = 20
VOXEL_RATIO = 0.06  # of the typical depth: the cells whose coverage is counted
STEP_RATIO = (0.15, 0.6)  # of the depth: how far a neighbour lies from its parent
TURN_DEG = (10.0, 60.0)
TRIED = (2.0, 2.0)  # as if so much gain had been put to the proof, and had passed it


@dataclass(frozen=True, eq=False)
class Exploration:
    """Where the choice of views stands: all that is needed to go on from there as if it had not been interrupted.

    `ratio`: of distance and width, as `candidates.measured_ratio` gave it; `ahead`: the sieve's candidates that were not looked
    at; `rng`: the state of the generator of random numbers; `pool`: sights that were not chosen; `taken`: those that were, in
    their order; `voxel`: scene units, 0 before there is any sight; `proof`: the gain of sights before a second eye looked, and
    after it, summed.
    """

    ratio: float
    ahead: tuple[Viewpoint, ...]
    rng: dict[str, Any]
    pool: tuple[Sight, ...] = ()
    taken: tuple[Sight, ...] = ()
    voxel: float = 0.0
    proof: tuple[float, float] = TRIED


def neighbour(parent: Sight, rng: np.random.Generator) -> Viewpoint:
    """A viewpoint a step and a turn away from `parent`."""
    way, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    step = rng.uniform(*STEP_RATIO) * parent.depth
    turn = so3_exp(np.radians(rng.uniform(*TURN_DEG)) * axis)
    return Viewpoint(parent.viewpoint.centre + step * way, turn @ parent.viewpoint.direction, parent.depth)


@dataclass
class Coverage:
    """How well each voxel of the scene has been shown, and what a sight adds: the sum over the voxels of its points of
    w / (1 + t)^2, with w the largest weight of the sight there and t the sum of those before it.
    """

    voxel: float
    shown: dict[tuple[int, ...], float] = field(default_factory=dict)

    def voxels(self, sight: Sight) -> dict[tuple[int, ...], float]:
        """The voxels that hold the sight's points, and the largest weight in each."""
        out: dict[tuple[int, ...], float] = {}
        keys = map(tuple, np.floor(sight.points / self.voxel).astype(np.int64).tolist())
        for key, weight in zip(keys, sight.weight.tolist(), strict=True):
            out[key] = max(weight, out.get(key, 0.0))
        return out

    def gain(self, sight: Sight) -> float:
        gain = sum(w / (1 + self.shown.get(key, 0.0)) ** 2 for key, w in self.voxels(sight).items())
        return gain * float(sight.weight.mean())

    def add(self, sight: Sight) -> None:
        for key, w in self.voxels(sight).items():
            self.shown[key] = self.shown.get(key, 0.0) + w


class Explorer:
    """Chooses sights for the map, the most useful first."""

    def __init__(self, scout: Scout, begun: Exploration) -> None:
        self._scout, self._ratio = scout, begun.ratio
        self._ahead = list(begun.ahead)
        self._rng = np.random.default_rng()
        self._rng.bit_generator.state = begun.rng
        self._pool, self._taken = list(begun.pool), list(begun.taken)
        self._before, self._after = begun.proof
        self._coverage = Coverage(begun.voxel)
        for sight in self._taken:
            self._coverage.add(sight)

    def state(self) -> Exploration:
        """Where the choice stands now; to be asked for between two steps of `choices`."""
        proof = self._before, self._after
        rng = dict(self._rng.bit_generator.state)
        pool, taken = tuple(self._pool), tuple(self._taken)
        return Exploration(self._ratio, tuple(self._ahead), rng, pool, taken, self._coverage.voxel, proof)

    def choices(self) -> Iterator[Sight | None]:
        """Sights in the order of their use, and None after each look in between; ends where FRUITLESS rounds in a row have
        found nothing to see.
        """
        fruitless = 0
        while fruitless < FRUITLESS:
            for viewpoint in self._next_looks():
                found = self._scout.sight(viewpoint)
                self._pool += [] if found is None else [found]
                yield None
            fruitless = 0 if self._pool else fruitless + 1
            if not self._pool:
                continue
            if not self._coverage.voxel:
                self._coverage = Coverage(VOXEL_RATIO * float(np.median([s.viewpoint.depth for s in self._pool])))
            yield from self._best()

    def _next_looks(self) -> Sequence[Viewpoint]:
        """What to look at next: of the sieve's candidates, and around a sight that was chosen."""
        fresh = 1 if self._taken else FIRST_LOOKS
        looks, self._ahead = self._ahead[:fresh], self._ahead[fresh:]
        if self._taken:
            looks.append(neighbour(self._taken[int(self._rng.integers(len(self._taken)))], self._rng))
        return looks

    def _best(self) -> Iterator[Sight | None]:
        """Takes the sight that adds most out of the pool. Proof lowers what a sight adds, so that few need it: what others have
        lost by it so far is expected of those that were not put to it.
        """
        gains = [self._coverage.gain(sight) for sight in self._pool]
        while self._pool:
            kept = self._after / self._before
            top = int(np.argmax([gain * (1 if s.proven else kept) for gain, s in zip(gains, self._pool, strict=True)]))
            sight, gain = self._pool.pop(top), gains.pop(top)
            if sight.proven:
                self._coverage.add(sight)
                self._taken.append(sight)
                yield sight
                return
            proven = self._scout.proven(sight)
            self._before += gain
            if proven is not None:
                self._pool.append(proven)
                gains.append(self._coverage.gain(proven))
                self._after += gains[-1]
            yield None
