"""Candidate viewpoints from the scan alone, and the order in which to look at them.

Positions lie at about the expected distance from some surface, so that orbits, interiors and streets arise by themselves; the
panorama around each says what its views would show; a greedy choice spreads them over the surface.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray
from .panorama import CELLS, Panorama, cell_directions, panorama_at, view_directions
from .surface import Surface

CONE_COS = float(np.cos(np.radians(33.0)))  # a square view of 65 degrees, without its corners
MOST_FILLED, SOME_FILLED = 0.5, 0.1  # of a view's cells: of places all around; of things that stand alone in the void
VIEWS_A_POSITION = 5
ELEMENTS = 5000  # surface points whose coverage is counted
NEAREST, FARTHEST = 0.6, 2.0  # of the expected distance, of the position from the point it was drawn for
RATIOS = tuple(25 * 11.2 ** (np.arange(11) / 7))  # up to 788
FACING_PULL = 5.0  # how much a position prefers the side that its point faces; a facing is about 0.5 long, the noise 1.7
SIGMA_LOG = 0.5  # of the distances around the expected one


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A view worth a look: `centre` (3,) and viewing `direction` (3,) in the world; `depth`: about how far away things are
    there, scene units.
    """

    centre: FloatArray
    direction: FloatArray
    depth: float


@dataclass(frozen=True, eq=False)
class Candidate:
    """A viewpoint, what it covers: `element` (K,) indices and how well, `weight` (K,), and its `share`: filled cells of the
    view times the root of those of the whole panorama, which puts views inside rooms.
    """

    viewpoint: Viewpoint
    element: NDArray[np.intp]
    weight: NDArray[np.float32]
    share: float


def measured_ratio(surface: Surface, positions: int, rng: np.random.Generator, filled: float = MOST_FILLED) -> float:
    """From how many widths away the surface was probably photographed: the ratio under which the views of random positions see
    most of it at its expected distance and from its side. Too small a ratio puts positions too near to see much, too large a
    one behind walls.
    """
    total = np.zeros(len(RATIOS))
    for k, ratio in enumerate(RATIOS):
        for some in candidate_views(surface, (ratio,), positions, rng, filled):
            total[k] += sum(float(one.weight.sum()) for one in some)
    top = int(np.clip(total.argmax(), 1, len(total) - 2))
    low, middle, high = np.log(np.maximum(total[top - 1 : top + 2], 1e-6))
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend < 0 else 0.0  # the top of the parabola through three points
    return float(RATIOS[top] * (RATIOS[1] / RATIOS[0]) ** np.clip(shift, -1, 1))


def candidate_views(
    surface: Surface, ratios: tuple[float, ...], positions: int, rng: np.random.Generator, filled: float = MOST_FILLED
) -> Iterator[list[Candidate]]:
    """The views of `positions` random positions, those of one at a time. `ratios`: expected distances as multiples of the
    surface's width, taken in turn; `filled`: the least share of a view's cells that hold something.
    """
    directions, cells = view_directions(), cell_directions()
    sieve = _Sieve((directions @ cells.T > CONE_COS).astype(np.float32), directions, filled)
    for index in range(positions if len(surface) else 0):
        expected = np.float32(ratios[index % len(ratios)]) * surface.width
        anchor = int(rng.integers(len(surface)))
        away = FACING_PULL * surface.facing[anchor] + rng.normal(size=3)
        stretch = np.exp(rng.uniform(np.log(NEAREST), np.log(FARTHEST))) * expected[anchor] / np.linalg.norm(away)
        position = surface.points[anchor] + (stretch * away).astype(np.float32)
        yield _views_at(position, panorama_at(surface, position, expected, SIGMA_LOG), sieve, surface)


@dataclass(frozen=True, eq=False)
class _Sieve:
    """`cone` (V, CELLS), 1 where a cell is in the view along `directions` (V, 3); `filled` as in `candidate_views`."""

    cone: NDArray[np.float32]
    directions: NDArray[np.float32]
    filled: float


def _views_at(position: NDArray[np.float32], panorama: Panorama, sieve: _Sieve, surface: Surface) -> list[Candidate]:
    cone, directions = sieve.cone, sieve.directions
    total = cone @ np.bincount(panorama.cell, panorama.weight, minlength=CELLS)
    filled = cone @ panorama.filled.astype(np.float32) / cone.sum(axis=1)
    total[filled <= sieve.filled] = 0
    out = []
    for best in np.argsort(-total)[:VIEWS_A_POSITION]:
        if total[best] <= 0:
            break
        inside = (cone[best] > 0)[panorama.cell]
        depth = weighted_median(panorama.distance[inside], panorama.seen[inside])
        own = np.flatnonzero(inside[:ELEMENTS] & (panorama.weight[:ELEMENTS] > 0.02))
        back = position - surface.points[own]
        bins = (back @ directions.T).argmax(axis=1)
        view = Viewpoint(position.astype(np.float64), directions[best].astype(np.float64), depth)
        share = float(filled[best] * np.sqrt(panorama.filled_share))
        out.append(Candidate(view, own * len(directions) + bins, panorama.weight[own], share))
    return out


def weighted_median(values: NDArray[np.float32], weights: NDArray[np.float32]) -> float:
    """The value below which half of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def spread_out(candidates: list[Candidate]) -> Iterator[Candidate]:
    """The candidates in greedy order of what each adds to those before it.

    The gain of an element is log(1 + a / (1 + t)), with a what its direction bin still lacks of 1 and t what it has over all
    bins: the logarithm keeps one detailed object from taking all views. Gains only fall, so old ones are bounds (lazy greedy).
    """
    bins = len(view_directions())
    by_bin = np.zeros(ELEMENTS * bins, np.float32)
    by_element = np.zeros(ELEMENTS, np.float32)

    def gain(index: int) -> float:
        one = candidates[index]
        added = np.minimum(one.weight, np.maximum(1 - by_bin[one.element], 0))
        return one.share * float(np.log1p(added / (1 + by_element[one.element // bins])).sum())

    heap = [(-gain(i), i) for i in range(len(candidates))]
    heapq.heapify(heap)
    while heap:
        _, index = heapq.heappop(heap)
        now = gain(index)
        if heap and -heap[0][0] > now:
            heapq.heappush(heap, (-now, index))
            continue
        one = candidates[index]
        added = np.minimum(one.weight, np.maximum(1 - by_bin[one.element], 0))
        by_bin[one.element] += added
        np.add.at(by_element, one.element // bins, added)
        yield one
