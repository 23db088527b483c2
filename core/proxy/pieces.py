"""The pieces and the borders of a mesh: floaters dropped, holes closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import FloatArray

IntArray = NDArray[np.int64]

FLOATER = 0.001  # a piece of less than this share of the triangles is a floater


def compacted(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Vertices (V, 3) and faces (F, 3) without the vertices that no face has."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    number = np.cumsum(used) - 1
    return vertices[used], number[faces]


def without_floaters(faces: IntArray, count: int) -> IntArray:
    """The faces of pieces that have at least FLOATER of all; `count`: of vertices."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if len(faces) == 0:
        return faces
    starts, ends = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    links = coo_array((np.ones(len(starts), bool), (starts, ends)), shape=(count, count))
    _, piece = connected_components(links, directed=False)
    own = piece[faces[:, 0]]
    sizes = np.bincount(own)
    return np.asarray(faces[sizes[own] >= FLOATER * len(faces)])


def open_edges(faces: IntArray) -> IntArray:
    """Edges of one face alone (E, 2), in its direction."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, index, count = np.unique(low * (faces.max(initial=0) + 1) + high, return_index=True, return_counts=True)
    return np.asarray(edges[index[count == 1]])


def border_loops(faces: IntArray) -> list[IntArray]:
    """The borders as closed chains of vertices, in the direction of their faces; where one touches itself, it is cut in two."""
    after: dict[int, list[int]] = {}
    for start, end in open_edges(faces).tolist():
        after.setdefault(start, []).append(end)
    loops: list[IntArray] = []
    path: list[int] = []
    place: dict[int, int] = {}  # of each vertex on the path
    while after or path:
        if not path:
            path.append(next(iter(after)))
            place[path[0]] = 0
        here = path[-1]
        if here not in after:
            del place[path.pop()]
            continue
        following = after[here].pop()
        if not after[here]:
            del after[here]
        if following not in place:
            place[following] = len(path)
            path.append(following)
            continue
        begin = place[following]
        loops.append(np.array(path[begin:], np.int64))
        for gone in path[begin + 1 :]:
            del place[gone]
        del path[begin + 1 :]
    return loops


def with_holes_closed(vertices: FloatArray, faces: IntArray, widest: FloatArray) -> tuple[FloatArray, IntArray]:
    """The mesh with a fan of triangles over each hole; `widest` (V,): how wide a hole at a vertex may be, scene units. Wider
    ones are borders, and stay.
    """
    middles: list[FloatArray] = []
    fans: list[IntArray] = []
    for loop in border_loops(faces):
        corners = vertices[loop]
        if len(loop) < 3 or np.linalg.norm(np.ptp(corners, axis=0)) > widest[loop].mean():
            continue
        middle = np.full(len(loop), len(vertices) + len(middles))
        middles.append(corners.mean(axis=0))
        fans.append(np.stack([np.roll(loop, -1), loop, middle], axis=1))
    if not fans:
        return vertices, faces
    return np.concatenate([vertices, middles]), np.concatenate([faces, *fans])
