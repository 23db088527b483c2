"""What the renderer computes once per scene: origin-centred means, scaled axes, log opacities, colour polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geometry.quaternion import rotations_of
from ..splats.scene import GaussianScene
from . import constants as c
from .color import color_polynomials
from .scan.blocks import SceneBlocks
from .scan.order import spatial_order
from .sharing import ThreadTeam

Float32Array = NDArray[np.float32]

# Rows of the block without those of the colours.
ROWS = 16
# Most Gaussians in one item of work: a dozen float32 columns of so many stay in the processor's cache.
CHUNK = 1 << 15

# The margin keeps rounding at the ellipse's edge from losing a pixel whose alpha reaches 1/255.
CUT_MARGIN = 2e-3


@dataclass(frozen=True)
class TablesFile:
    """A file that holds the block of tables from the byte `offset` on, which is a multiple of a page."""

    path: str
    offset: int


@dataclass(frozen=True, eq=False)
class SceneTables:
    """N Gaussians of opacity >= 1/255, neighbours beside each other (`order.py`), one row per quantity.

    origin (3,) float64: added to `means` (3, N) float32 gives world coordinates. body (11, N), gathered at once: row 3 i + j
    is world axis i of scaled Gaussian axis j, then log opacity, then the cut 2 ln(255 opacity), the squared Mahalanobis radius
    at which alpha is 1/255. reach (N,): sqrt(cut) times the largest scale, scene units. rank (N,) int32: the Gaussian's number
    in the file, which settles who is drawn first of those of one depth. color (K, 3, N): RGB as a polynomial of the unit
    direction, see `color.py`. All of these are rows of `block` (ROWS + 3 K, N), so that they can lie in one file.
    `antialiased` as in GaussianScene. `file`: where other processes can map the block, if it lies in a file.
    """

    origin: NDArray[np.float64]
    block: Float32Array
    antialiased: bool = False
    file: TablesFile | None = None

    @property
    def means(self) -> Float32Array:
        return self.block[:3]

    @property
    def body(self) -> Float32Array:
        return self.block[3:14]

    @property
    def reach(self) -> Float32Array:
        row: Float32Array = self.block[14]
        return row

    @property
    def rank(self) -> NDArray[np.int32]:
        return np.asarray(self.block[15].view(np.int32))

    @cached_property
    def blocks(self) -> SceneBlocks:
        """The blocks of neighbours, found at first use."""
        return SceneBlocks.of(self.means, self.reach)

    @property
    def color(self) -> Float32Array:
        return self.block[ROWS:].reshape((len(self.block) - ROWS) // 3, 3, len(self))

    def __len__(self) -> int:
        return int(self.block.shape[1])


def build_tables(scene: GaussianScene, threads: int = 1) -> SceneTables:
    """Per-scene tables; Gaussians too transparent to ever count are left out. The threads change no bit of them."""
    keep = np.flatnonzero(scene.opacities >= np.float32(c.ALPHA_MIN))
    n = len(keep)
    means = scene.means[keep]
    origin = np.median(means, axis=0).astype(np.float64) if n else np.zeros(3)
    means -= origin.astype(np.float32)
    keep = keep[spatial_order(means, scene.scales[keep].max(axis=1, initial=0.0))]
    del means
    tables = SceneTables(origin, np.empty((ROWS + 3 * scene.sh.shape[1], n), np.float32), scene.antialiased)
    parts = [slice(a, a + CHUNK) for a in range(0, n, CHUNK)]
    with ThreadTeam(threads) as team:
        team.run(lambda part: _fill(tables, scene, keep[part], part), parts)
    return tables


def _fill(tables: SceneTables, scene: GaussianScene, index: NDArray[np.intp], part: slice) -> None:
    tables.means[:, part] = (scene.means[index] - tables.origin).T
    scales, opacities = scene.scales[index], scene.opacities[index]
    cut = np.maximum(2 * np.log(opacities / np.float32(c.ALPHA_MIN)), np.float32(0)) + np.float32(CUT_MARGIN)
    tables.reach[part] = np.sqrt(cut) * scales.max(axis=1, initial=0.0)
    tables.body[:9, part] = (rotations_of(scene.rotations[index]) * scales[:, None, :]).reshape(-1, 9).T
    tables.body[9, part], tables.body[10, part] = np.log(opacities), cut
    tables.rank[part] = index
    tables.color[:, :, part] = color_polynomials(scene.sh.take(index, axis=0))
