"""Which views are worth a place in the map: cheap looks at many, and a greedy choice by what stays in place between two eyes.

A splat looks right only from about where it was photographed. There, features of two renders side by side match and their
lifted points agree; behind a wall or among floaters they do not. Views are chosen for the stable points that few views before
them have shown, and new candidates are looked for around those that were chosen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...features.matchers.nearest import MutualNearest
from ...geometry.camera import FloatArray, Pose
from ...geometry.lie import so3_exp
from .candidates import Viewpoint
from .eye import Eye, RenderedFeatures, facing, square_camera
from .panorama import facing_log
from .surface import Surface

FIRST_LOOK_PX = 144
BASELINE = 0.12  # between the two eyes, of the depth
STABLE_RATIO = 0.03  # of the depth: how far two lifts of one feature may lie apart
FIRST_LOOKS = 12
FRUITLESS = 20
FEWEST_POINTS = 5
SIDE_GAIN = 2.0  # how much sharper than the sieve a sight is judged by the side from which it is seen
LEAST_SOLID = 0.1
VOXEL_RATIO = 0.06  # of the typical depth: the cells whose coverage is counted
STEP_RATIO = (0.15, 0.6)  # of the depth: how far a neighbour lies from its parent
TURN_DEG = (10.0, 60.0)


@dataclass(frozen=True, eq=False)
class Sight:
    """A view that was looked at: its pose; `depth` (scene units), which its near plane was set by; `found`, the features of the
    first eye; `points` (N, 3) in the world, of those or, once `proven` by a second eye, of the stable ones; and `weight` (N,),
    0..1, how plausible it is that a photograph saw them from this side.
    """

    pose: Pose
    depth: float
    found: RenderedFeatures
    points: FloatArray
    weight: NDArray[np.float32]
    proven: bool = False


class Scout:
    """Looks at viewpoints with small renders."""

    def __init__(self, eye: Eye, surface: Surface) -> None:
        self._eye, self._surface = eye, surface
        self._tree = cKDTree(surface.points)
        self._camera = square_camera(FIRST_LOOK_PX)

    def sight(self, viewpoint: Viewpoint) -> Sight | None:
        """What one eye sees there; None where that is mostly nothing."""
        pose = Pose.from_centre(facing(viewpoint.direction), viewpoint.centre)
        look = self._eye.look(pose, self._camera, viewpoint.depth)
        if look.solid < LEAST_SOLID or len(look.features) < FEWEST_POINTS:
            return None
        return Sight(pose, viewpoint.depth, look, look.points, self._weight(pose, look.points))

    def proven(self, sight: Sight) -> Sight | None:
        """The sight with those of its points that a second eye at its side sees at the same places; None where too few are."""
        pose, depth = sight.pose, sight.found.depth
        aside = Pose.from_centre(pose.R, pose.centre + BASELINE * depth * pose.R[0])
        other = self._eye.look(aside, self._camera, sight.depth)
        pairs = MutualNearest().match(sight.found.features, other.features).indices
        first, second = sight.found.points[pairs[:, 0]], other.points[pairs[:, 1]]
        stable = first[np.linalg.norm(first - second, axis=1) < STABLE_RATIO * depth]
        if len(stable) < FEWEST_POINTS:
            return None
        return replace(sight, points=stable, weight=self._weight(pose, stable), proven=True)

    def _weight(self, pose: Pose, points: FloatArray) -> NDArray[np.float32]:
        _, nearest = self._tree.query(points)
        ray = (points - pose.centre).astype(np.float32)
        side = facing_log(self._surface.facing[nearest], ray, np.linalg.norm(ray, axis=1))
        return np.asarray(np.exp(SIDE_GAIN * side), np.float32)


def neighbour(parent: Sight, rng: np.random.Generator) -> Viewpoint:
    """A viewpoint a step and a turn away from `parent`."""
    way, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    step = rng.uniform(*STEP_RATIO) * parent.found.depth
    turn = so3_exp(np.radians(rng.uniform(*TURN_DEG)) * axis)
    return Viewpoint(parent.pose.centre + step * way, turn @ parent.pose.R[2], parent.found.depth)


class Coverage:
    """How well each voxel of the scene has been shown, and what a sight adds: the sum over the voxels of its points of
    w / (1 + t)^2, with w the largest weight of the sight there and t the sum of those before it.
    """

    def __init__(self, voxel: float) -> None:
        self._voxel = voxel
        self._shown: dict[tuple[int, ...], float] = {}

    def voxels(self, sight: Sight) -> dict[tuple[int, ...], float]:
        """The voxels that hold the sight's points, and the largest weight in each."""
        out: dict[tuple[int, ...], float] = {}
        keys = map(tuple, np.floor(sight.points / self._voxel).astype(np.int64).tolist())
        for key, weight in zip(keys, sight.weight.tolist(), strict=True):
            out[key] = max(weight, out.get(key, 0.0))
        return out

    def gain(self, sight: Sight) -> float:
        gain = sum(w / (1 + self._shown.get(key, 0.0)) ** 2 for key, w in self.voxels(sight).items())
        return gain * float(sight.weight.mean())

    def add(self, sight: Sight) -> None:
        for key, w in self.voxels(sight).items():
            self._shown[key] = self._shown.get(key, 0.0) + w


def chosen(
    scout: Scout, viewpoints: Iterator[Viewpoint], per_view: tuple[int, int], rng: np.random.Generator
) -> Iterator[Sight]:
    """Sights for the map, the most useful first; ends where FRUITLESS rounds in a row have found nothing to see.

    `per_view`: how many new candidates are looked at for each sight that is chosen, of `viewpoints` and of neighbours.
    """
    pool: list[Sight] = []
    taken: list[Sight] = []
    coverage: Coverage | None = None
    fruitless = 0
    while fruitless < FRUITLESS:
        fresh = list(islice(viewpoints, per_view[0] if taken else FIRST_LOOKS))
        if taken:
            fresh += [neighbour(taken[int(rng.integers(len(taken)))], rng) for _ in range(per_view[1])]
        pool += [found for v in fresh if (found := scout.sight(v)) is not None]
        fruitless = 0 if pool else fruitless + 1
        if not pool:
            continue
        if coverage is None:
            coverage = Coverage(VOXEL_RATIO * float(np.median([s.depth for s in pool])))
        best = _best(scout, pool, coverage)
        if best is not None:
            coverage.add(best)
            taken.append(best)
            yield best


def _best(scout: Scout, pool: list[Sight], coverage: Coverage) -> Sight | None:
    """Takes the sight that adds most out of `pool`. Proof only lowers what a sight adds, so that few need it (lazy greedy)."""
    gains = [coverage.gain(sight) for sight in pool]
    while pool:
        top = int(np.argmax(gains))
        sight = pool.pop(top)
        gains.pop(top)
        if sight.proven:
            return sight
        proven = scout.proven(sight)
        if proven is not None:
            pool.append(proven)
            gains.append(coverage.gain(proven))
    return None
