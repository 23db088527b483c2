"""Fewer triangles, first of all where the surface is flat: edges collapse in rounds, many that do not touch each other at once.

The cost is that of Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997: the squared distances from
the planes of all faces that were merged into a vertex. It is measured in cells of the grid, which grow with the distance from
the cameras, so that what is far away may be off by more.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray
from .pieces import IntArray, compacted, open_edges

BoolArray = NDArray[np.bool_]

BORDER = 4.0  # how much more a border counts than a face
POOL = 0.5  # the share of the edges, the cheapest ones, that may collapse in a round
KEPT_TURN = 0.2  # the least cosine between a face's normal before and after
SLIVER = 1e-3  # of its area before: a face with less has none
STALLED = 0.01  # a round that removes less than this share of the faces is the last one that is careful
REST = 8  # rounds after which edges that could not collapse are tried again
MOST_ROUNDS = 300
# Where the entries of a quadric's symmetric matrix stand among its ten numbers; its vector and its constant follow.
PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
TWICE = np.array([1.0, 2, 2, 1, 2, 1, 2, 2, 2, 1])


@dataclass(frozen=True, eq=False)
class _Mesh:
    """What the rounds change in place: vertices (V, 3); quadrics (10, V): x^T A x + 2 b^T x + c; `resting` (V,): whether an
    edge there could not collapse of late.
    """

    vertices: FloatArray
    quadrics: FloatArray
    resting: BoolArray


def decimated(
    vertices: FloatArray, faces: IntArray, budget: int, cell: FloatArray
) -> Generator[float, None, tuple[FloatArray, IntArray]]:
    """Vertices and faces, at most `budget` of them; `cell` (V,): the grid cell's size at each vertex, scene units. Yields the
    share 0..1 that is done.
    """
    whole, careful = len(faces), True
    if whole <= budget:
        return vertices, faces
    mesh = _Mesh(vertices.copy(), _quadrics(vertices, faces, cell), np.zeros(len(vertices), bool))
    rng = np.random.default_rng(0)
    for number in range(MOST_ROUNDS):
        before = len(faces)
        if number % REST == 0:
            mesh.resting[:] = False
        faces = _round(mesh, faces, _Pace(budget, careful, rng))
        yield min(1.0, (whole - len(faces)) / (whole - budget))
        if len(faces) <= budget:
            break
        careful = careful and before - len(faces) >= STALLED * before
    return compacted(mesh.vertices, faces)


def _quadrics(vertices: FloatArray, faces: IntArray, cell: FloatArray) -> FloatArray:
    """The quadrics (10, V) of the planes of each vertex's faces, and of planes that stand on the borders."""
    normal, area = _normals(vertices, faces)
    planes = [(faces, normal, area / cell[faces].mean(axis=1) ** 4)]
    borders = open_edges(faces)
    if len(borders):
        along = vertices[borders[:, 1]] - vertices[borders[:, 0]]
        upright = _unit(np.cross(along, _vertex_normals(len(vertices), faces, normal)[borders[:, 0]]))
        planes.append((borders, upright, BORDER * (along**2).sum(axis=1) / cell[borders[:, 0]] ** 4))
    out = np.zeros((10, len(vertices)))
    for corners, n, weight in planes:
        d = -(n * vertices[corners[:, 0]]).sum(axis=1)
        numbers = [*(n[:, k] * n[:, m] for k, m in PLACES), *(d * n.T), d * d]
        for number, values in enumerate(numbers):
            for corner in corners.T:
                out[number] += np.bincount(corner, weight * values, len(vertices))
    return out


@dataclass(frozen=True)
class _Pace:
    """`careful`: what would turn a face over or pinch the surface together stays as it is."""

    budget: int
    careful: bool
    rng: np.random.Generator


def _round(mesh: _Mesh, faces: IntArray, how: _Pace) -> IntArray:
    """The faces after one round."""
    edges, shared = _edges(faces, len(mesh.vertices))
    border = np.zeros(len(mesh.vertices), bool)
    border[edges[shared == 1]] = True
    cost = _cheapest(mesh, edges)
    if how.careful:
        # An edge between two borders that is no border itself would tie them together.
        tied = (shared > 2) | (border[edges].all(axis=1) & (shared != 1))
        cost[tied | mesh.resting[edges].all(axis=1)] = np.inf
    chosen = _independent(edges, cost, len(mesh.vertices), how.rng)
    chosen = chosen[np.argsort(cost[chosen])][: max(1, (len(faces) - how.budget + 1) // 2)]
    kept, gone = edges[chosen].T
    swap = border[gone] & ~border[kept]
    kept, gone = np.where(swap, gone, kept), np.where(swap, kept, gone)
    places = _best_places(mesh, kept, gone, border)
    good = np.ones(len(kept), bool)
    if how.careful:
        good = _is_linked(faces, kept, gone, shared[chosen], len(mesh.vertices)) & ~_turns(mesh, faces, kept, gone, places)
        mesh.resting[kept[~good]] = mesh.resting[gone[~good]] = True
    kept, gone = kept[good], gone[good]
    mesh.vertices[kept] = places[good]
    mesh.quadrics[:, kept] += mesh.quadrics[:, gone]
    return _renumbered(faces, kept, gone, len(mesh.vertices))


def _edges(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Edges (E, 2), and how many faces have each (E,)."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys, shared = np.unique(ends[:, 0] * count + ends[:, 1], return_counts=True)
    return np.stack(np.divmod(keys, count), axis=1), shared


def _cheapest(mesh: _Mesh, edges: IntArray) -> FloatArray:
    """The cost of each edge at the best of its ends and its middle."""
    places, quadrics = np.ascontiguousarray(mesh.vertices.T), mesh.quadrics
    own = _value(quadrics, places)
    a, b = edges.T
    one, other, here, there = quadrics[:, a], quadrics[:, b], places[:, a], places[:, b]
    at_a, at_b = own[a] + _value(other, here), own[b] + _value(one, there)
    # A quadratic's value in the middle is the mean of those at the ends, less a quarter of its bend between them.
    bend = _value(one[:6] + other[:6], there - here)
    return np.asarray(np.minimum(np.minimum(at_a, at_b), (at_a + at_b) / 2 - bend / 4))


def _value(quadrics: FloatArray, places: FloatArray) -> FloatArray:
    """Of quadrics (10, N), or their matrices alone (6, N), at places (3, N)."""
    out = np.zeros(places.shape[1])
    for row, twice, (k, m) in zip(quadrics[:6], TWICE, PLACES, strict=False):
        out += twice * row * places[k] * places[m]
    if len(quadrics) > 6:
        out += 2 * (quadrics[6:9] * places).sum(axis=0) + quadrics[9]
    return out


def _independent(edges: IntArray, cost: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Indices of cheap edges of which no two have neighbours in common, picked by lot: the cheapest alone lie side by side."""
    pool = np.flatnonzero(np.isfinite(cost))
    size = max(1, int(POOL * len(pool)))
    if len(pool) > size:
        pool = pool[np.argpartition(cost[pool], size)[:size]]
    rank = np.full(len(edges), len(edges), np.int64)
    rank[pool] = rng.permutation(len(pool))
    own = _least(edges, rank[:, None].repeat(2, axis=1), count, len(edges))
    near = _least(edges, own[edges[:, ::-1]], count, len(edges))
    best = np.minimum(own, near)[edges]
    return np.asarray(pool[(best[pool] == rank[pool, None]).all(axis=1)])


def _least(edges: IntArray, values: IntArray, count: int, none: int) -> IntArray:
    """The least of the values (E, 2) that the edges bring to each of `count` vertices."""
    out = np.full(count, none, np.int64)
    np.minimum.at(out, edges.ravel(), values.ravel())
    return out


def _is_linked(faces: IntArray, kept: IntArray, gone: IntArray, shared: IntArray, count: int) -> BoolArray:
    """Whether the two ends have no other neighbours in common than the corners of the faces at their edge: else the surface
    would be pinched together.
    """
    from scipy.sparse import csr_array

    starts, ends = faces[:, [0, 1, 1, 2, 2, 0]].ravel(), faces[:, [1, 0, 2, 1, 0, 2]].ravel()
    links = csr_array((np.ones(len(starts), np.int32), (starts, ends)), shape=(count, count))
    links.data[:] = 1
    common = (links[kept] > 0).multiply(links[gone] > 0).sum(axis=1)
    return np.asarray(np.asarray(common).ravel() == shared)


def _best_places(mesh: _Mesh, kept: IntArray, gone: IntArray, border: BoolArray) -> FloatArray:
    """Where the merged vertices cost least: near the middle of the edge where flatness leaves it open; on the border's vertex
    where one end alone is on the border.
    """
    ends = mesh.vertices[kept], mesh.vertices[gone]
    middle, merged = (ends[0] + ends[1]) / 2, mesh.quadrics[:, kept] + mesh.quadrics[:, gone]
    A = np.empty((len(kept), 3, 3))
    for row, (k, m) in zip(merged[:6], PLACES, strict=True):
        A[:, k, m] = A[:, m, k] = row
    hold = 1e-3 * np.trace(A, axis1=1, axis2=2) + 1e-30
    pull = -(np.einsum("nij,nj->ni", A, middle) + merged[6:9].T)
    step = np.linalg.solve(A + hold[:, None, None] * np.eye(3), pull[..., None])[..., 0]
    reach = np.linalg.norm(ends[0] - ends[1], axis=1)
    step *= np.minimum(1, reach / np.maximum(np.linalg.norm(step, axis=1), 1e-30))[:, None]
    return np.where((border[kept] & ~border[gone])[:, None], ends[0], middle + step)


def _turns(mesh: _Mesh, faces: IntArray, kept: IntArray, gone: IntArray, places: FloatArray) -> BoolArray:
    """Which collapses turn a face over, or take its area from it. No two touch the same face."""
    moves = np.full(len(mesh.vertices), -1)
    moves[kept] = moves[gone] = np.arange(len(kept))
    who = moves[faces]
    touched = np.flatnonzero((who >= 0).any(axis=1))
    who = who[touched]
    stays = (who >= 0).sum(axis=1) == 1  # a face that has both ends goes
    touched, who = touched[stays], who[stays]
    corners = mesh.vertices[faces[touched]]
    old, old_area = _normals_of(corners)
    moved = np.where((who >= 0)[..., None], places[who], corners)
    new, new_area = _normals_of(moved)
    turned = ((old * new).sum(axis=1) < KEPT_TURN) | (new_area < SLIVER * old_area)
    out = np.zeros(len(kept), bool)
    out[who.max(axis=1)[turned]] = True
    return out


def _renumbered(faces: IntArray, kept: IntArray, gone: IntArray, count: int) -> IntArray:
    """The faces after collapses, without those that became lines."""
    number = np.arange(count)
    number[gone] = kept
    after = number[faces]
    lines = (after[:, 0] == after[:, 1]) | (after[:, 1] == after[:, 2]) | (after[:, 2] == after[:, 0])
    return np.asarray(after[~lines])


def _normals(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (F, 3), zero for a face without area, and areas (F,)."""
    return _normals_of(vertices[faces])


def _normals_of(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As `_normals`, of corners (F, 3, 3)."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-30)[:, None], length / 2


def _vertex_normals(count: int, faces: IntArray, normals: FloatArray) -> FloatArray:
    sums = [sum(np.bincount(corner, normals[:, k], count) for corner in faces.T) for k in range(3)]
    return _unit(np.stack(sums, axis=1))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30))
