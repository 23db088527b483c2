"""Where the choice of a map's views stands, as arrays for the map's file and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .viewpoints.candidates import Viewpoint
from .viewpoints.explore import Exploration
from .viewpoints.scout import Sight

PLACE = 7  # numbers of a viewpoint: centre, direction, depth
POOL, PROVEN, TAKEN = 0, 1, 2
NAMES = ("ahead", "sights", "sight_kinds", "sight_counts", "sight_points", "sight_weights")


def search_arrays(search: Exploration | None) -> tuple[dict[str, Any] | None, dict[str, NDArray[Any]]]:
    """What goes into the head of the file, as JSON, and the arrays. What a sight showed is seen again where it is needed."""
    if search is None:
        return None, {}
    sights = [*search.taken, *search.pool]
    kinds = [TAKEN] * len(search.taken) + [PROVEN if sight.proven else POOL for sight in search.pool]
    arrays = {
        "ahead": _places(search.ahead),
        "sights": np.column_stack([_places([s.viewpoint for s in sights]), [s.depth for s in sights]]).reshape(-1, PLACE + 1),
        "sight_kinds": np.array(kinds, np.uint8),
        "sight_counts": np.array([len(s.points) for s in sights], np.int64),
        "sight_points": np.concatenate([np.zeros((0, 3), np.float32), *(s.points for s in sights)]),
        "sight_weights": np.concatenate([np.zeros(0, np.float32), *(s.weight for s in sights)]),
    }
    return {"ratio": search.ratio, "voxel": search.voxel, "proof": list(search.proof), "rng": search.rng}, arrays


def search_of(head: Any, arrays: Mapping[str, NDArray[Any]]) -> Exploration | None:
    """The search that `search_arrays` took apart; None where there is none. Raises ValueError where it cannot be one."""
    if head is None:
        return None
    if not isinstance(head, dict) or any(name not in arrays for name in NAMES):
        raise ValueError("the search for viewpoints is not whole")
    ahead, places, kinds, counts, points, weights = (arrays[name] for name in NAMES)
    total = len(points)
    if ahead.shape != (len(ahead), PLACE) or places.shape != (len(counts), PLACE + 1) or kinds.shape != counts.shape:
        raise ValueError("the viewpoints' shapes do not fit each other")
    if points.shape != (total, 3) or weights.shape != (total,) or (counts < 0).any() or counts.sum() != total:
        raise ValueError("the sights' shapes do not fit each other")
    if not all(np.isfinite(array).all() for array in (ahead, places, points, weights)):
        raise ValueError("a viewpoint is not finite")
    ratio, voxel, proof = float(head["ratio"]), float(head["voxel"]), tuple(float(x) for x in head["proof"])
    if not (ratio > 0 and voxel >= 0 and len(proof) == 2 and min(proof) > 0):
        raise ValueError("a number of the search is out of range")
    np.random.default_rng().bit_generator.state = head["rng"]  # which raises ValueError, TypeError or KeyError
    ends = np.cumsum(counts)
    sights = [
        Sight(_viewpoint(place), float(place[-1]), points[e - c : e], weights[e - c : e], bool(kind))
        for place, kind, c, e in zip(places, kinds, counts.tolist(), ends.tolist(), strict=True)
    ]
    taken = tuple(sight for sight, kind in zip(sights, kinds, strict=True) if kind == TAKEN)
    pool = tuple(sight for sight, kind in zip(sights, kinds, strict=True) if kind != TAKEN)
    return Exploration(ratio, tuple(map(_viewpoint, ahead)), head["rng"], pool, taken, voxel, (proof[0], proof[1]))


def _places(viewpoints: Sequence[Viewpoint]) -> NDArray[np.float64]:
    return np.array([[*v.centre, *v.direction, v.depth] for v in viewpoints], np.float64).reshape(-1, PLACE)


def _viewpoint(place: NDArray[np.float64]) -> Viewpoint:
    return Viewpoint(place[:3], place[3:6], float(place[6]))
