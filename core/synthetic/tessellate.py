"""Painted rectangles turned into Gaussians: small ones where the picture has detail, large ones where it is plain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry.camera import FloatArray
from .surfaces import Surfels
from .textures import Picture

# Deviation within the surface, as a share of a cell's side: neighbours meet without a gap, and edges stay sharp.
FILL = 0.6
THICKNESS = 0.002  # scene units
MAX_SIDE = 0.22  # scene units: a larger Gaussian would spill over its neighbours
MAX_ASPECT = 5.0
# The share of the cells that is split in one round; the worst come first, and all are rated again afterwards.
SPLIT_SHARE = 0.35
CUTS = (0.3, 0.5, 0.7)
# The cost (squared colour) of a cell without detail, so that plain walls are not left to single cells.
PLAIN = 2e-4

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Panel:
    """A painted rectangle: `origin` is the picture's top-left corner, `across` and `down` its edges, in scene units."""

    picture: Picture
    origin: FloatArray
    across: FloatArray
    down: FloatArray

    @property
    def normal(self) -> FloatArray:
        return np.asarray(_axes(self)[:, 2])


def panel(picture: Picture, origin: ArrayLike, across: ArrayLike, down: ArrayLike) -> Panel:
    return Panel(picture, *(np.asarray(x, np.float64) for x in (origin, across, down)))


def box(pictures: list[Picture], low: ArrayLike, high: ArrayLike) -> list[Panel]:
    """The five visible faces of a box in a y-down world: front (low z), left, right, back, top (low y)."""
    (x0, y0, z0), (x1, y1, z1) = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag([x1 - x0, y1 - y0, z1 - z0])
    faces = [((x0, y0, z0), x, y), ((x0, y0, z1), -z, y), ((x1, y0, z0), z, y), ((x1, y0, z1), -x, y), ((x0, y0, z1), x, -z)]
    return [panel(pictures[k % len(pictures)], *face) for k, face in enumerate(faces)]


def tessellate(panels: list[Panel], budget: int, eye: FloatArray) -> Surfels:
    """About `budget` Gaussians over all panels, finest where the picture has most detail as seen from `eye`."""
    cells = _Cells(panels, eye)
    while len(cells) < budget:
        cells.split(min(budget - len(cells), max(1, round(SPLIT_SHARE * len(cells)))))
    return cells.surfels()


class _Cells:
    """Cells of all panels' pictures at once: `panel` (N,), `box` (N, 4) as x0 y0 x1 y1 in texels."""

    def __init__(self, panels: list[Panel], eye: FloatArray) -> None:
        self.panels = panels
        shapes = np.array([p.picture.shape[:2] for p in panels])
        self._stride = shapes[:, 1] + 1
        self._start = np.concatenate([[0], np.cumsum((shapes[:, 0] + 1) * self._stride)])[:-1]
        self._sums = np.concatenate([_integral(p.picture) for p in panels])
        self._side = np.array([[np.linalg.norm(p.across), np.linalg.norm(p.down)] for p in panels]) / shapes[:, ::-1]
        self._eye = eye
        self.panel, self.box = np.zeros(0, np.int64), np.zeros((0, 4), np.int64)
        self._cost = np.zeros(0)
        first = np.column_stack([np.zeros((len(panels), 2), np.int64), shapes[:, ::-1]])
        self._add(np.arange(len(panels)), first)

    def __len__(self) -> int:
        return len(self.panel)

    def split(self, count: int) -> None:
        """Split the `count` cells that cost most, each where its two halves are plainest."""
        worst = np.argpartition(-self._cost, min(count, len(self) - 1))[:count]
        panel, box = self.panel[worst], self.box[worst]
        best, halves = np.full(len(worst), np.inf), (box.copy(), box.copy())
        size = self._size(panel, box)
        for axis in (0, 1):
            length = box[:, axis + 2] - box[:, axis]
            for share in CUTS:
                at = box[:, axis] + np.clip(np.rint(share * length).astype(np.int64), 1, None)
                one, two = box.copy(), box.copy()
                one[:, axis + 2], two[:, axis] = at, at
                error = self._error(panel, one) + self._error(panel, two)
                error = np.where(size[:, axis] * 2 < size[:, 1 - axis], np.inf, error)  # no slivers
                error = np.where(size[:, axis] > MAX_ASPECT * size[:, 1 - axis], error * 0.01, error)
                take = (at < box[:, axis + 2]) & (error < best)
                best = np.where(take, error, best)
                halves[0][take], halves[1][take] = one[take], two[take]
        done = np.isfinite(best)
        self._cost[worst[~done]] = -1.0  # a single texel wide: nothing to gain
        keep = np.ones(len(self), bool)
        keep[worst[done]] = False
        self.panel, self.box, self._cost = self.panel[keep], self.box[keep], self._cost[keep]
        self._add(np.tile(panel[done], 2), np.concatenate([h[done] for h in halves]))

    def _add(self, panel: IntArray, box: IntArray) -> None:
        size = self._size(panel, box)
        cost = (self._error(panel, box) + PLAIN * np.prod(box[:, 2:] - box[:, :2], axis=1)) * self._weight(panel, box)
        cost = np.where(size.max(axis=1) > MAX_SIDE, cost + 1e9, cost)
        self.panel, self.box = np.concatenate([self.panel, panel]), np.concatenate([self.box, box])
        self._cost = np.concatenate([self._cost, cost])

    def _size(self, panel: IntArray, box: IntArray) -> FloatArray:
        return np.asarray((box[:, 2:] - box[:, :2]) * self._side[panel])

    def _weight(self, panel: IntArray, box: IntArray) -> FloatArray:
        """Image area per texel as seen from the eye; never nothing, so that unseen sides are closed too."""
        away = self._centres(panel, box) - self._eye
        distance = np.linalg.norm(away, axis=1)
        normals = np.array([p.normal for p in self.panels])[panel]
        facing = np.abs(np.einsum("ij,ij->i", normals, away)) / distance
        return np.asarray(np.prod(self._side[panel], axis=1) * np.maximum(facing, 0.15) / np.maximum(distance, 1.2) ** 2)

    def _centres(self, panel: IntArray, box: IntArray) -> FloatArray:
        middle = (box[:, :2] + box[:, 2:]) / 2
        frames = np.array([[p.origin, p.across / p.picture.shape[1], p.down / p.picture.shape[0]] for p in self.panels])[panel]
        return np.asarray(frames[:, 0] + middle[:, :1] * frames[:, 1] + middle[:, 1:] * frames[:, 2])

    def _total(self, panel: IntArray, box: IntArray) -> FloatArray:
        """Sums over each cell: r, g, b, and r^2 + g^2 + b^2, (N, 4)."""
        x0, y0, x1, y1 = box.T
        at = [self._start[panel] + y * self._stride[panel] + x for y, x in ((y1, x1), (y0, x1), (y1, x0), (y0, x0))]
        a, b, c, d = (self._sums[k] for k in at)
        return np.asarray(a - b - c + d)

    def _error(self, panel: IntArray, box: IntArray) -> FloatArray:
        """Squared distance of a cell's colours from their mean, summed over its texels."""
        total = self._total(panel, box)
        count = np.maximum(np.prod(box[:, 2:] - box[:, :2], axis=1), 1)
        return np.maximum(total[:, 3] - (total[:, :3] ** 2).sum(1) / count, 0)

    def surfels(self) -> Surfels:
        count = np.prod(self.box[:, 2:] - self.box[:, :2], axis=1)
        axes = np.array([_axes(p) for p in self.panels])[self.panel]
        scales = np.column_stack([FILL * self._size(self.panel, self.box), np.full(len(self), THICKNESS)])
        colors = self._total(self.panel, self.box)[:, :3] / count[:, None]
        return Surfels(self._centres(self.panel, self.box), axes, scales, colors)


def _axes(p: Panel) -> FloatArray:
    u, v = p.across / np.linalg.norm(p.across), p.down / np.linalg.norm(p.down)
    return np.column_stack([u, v, np.cross(u, v)])


def _integral(picture: Picture) -> FloatArray:
    """Integral image of r, g, b and their squares' sum, flattened to ((H + 1) (W + 1), 4)."""
    values = np.concatenate([picture, (picture**2).sum(2, keepdims=True)], axis=2).astype(np.float64)
    out = np.zeros((picture.shape[0] + 1, picture.shape[1] + 1, 4))
    out[1:, 1:] = values.cumsum(0).cumsum(1)
    return out.reshape(-1, 4)
