"""A sample of the scan's surfaces, and what training left in them of the photographs: from how far away, from which side.

Distance: a Gaussian is split until it is a few pixels wide in the photos that show it, so that its size tells their distance,
up to one factor (the photos' focal length in pixels divided by that width) that is the same for the whole scan and not known.

Side: three weak signs, joined. A gradient step changes a Gaussian's constant colour and its first spherical harmonics together,
so that these raise its contrast with its surroundings where it was seen from. Haze of faint Gaussians stands before surfaces,
in the space that photographs crossed. Large Gaussians stand behind, where no photograph asked for detail.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...geometry.camera import FloatArray
from ...render.constants import SH_C0
from ...splats.scene import GaussianScene

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Float32Array = NDArray[np.float32]

MIN_OPACITY = 0.25  # fainter Gaussians are haze, not surface
MAX_HAZE = 0.1  # opacity of the haze whose side is asked for
LARGEST_TREE = 400_000  # Gaussians of either kind that neighbours are looked for among; of more, as many drawn at random
WIDTH_NEIGHBOURS = 16
SIGN_POINTS, SIGN_NEIGHBOURS, HAZE_NEIGHBOURS = 5000, 64, 32
SMOOTH_NEIGHBOURS = 24  # points whose signs are averaged: one alone is right for 6 in 7, 24 together for 19 in 20 or more


@dataclass(frozen=True, eq=False)
class Surface:
    """`points` (N, 3) drawn uniformly from the opaque Gaussians, by count: detail gets many, floaters and sky get few.

    `width` (N,) scene units: the typical largest deviation of the Gaussians around each point; `area` (N,) scene units squared:
    the part of the scan's opaque cross-section that the point stands for, opacity included; `facing` (N, 3): the direction
    towards those who photographed it, its length 0..1 the agreement of the signs.
    """

    points: Float32Array
    width: Float32Array
    area: Float32Array
    facing: Float32Array

    def __len__(self) -> int:
        return len(self.points)


def sample_surface(scene: GaussianScene, count: int, rng: np.random.Generator) -> Surface:
    """At most `count` points of the scan; all opaque Gaussians where there are fewer, none where the scan has none."""
    opaque = np.flatnonzero(scene.opacities > MIN_OPACITY)
    pick = _draw(opaque, count, rng)
    if len(pick) == 0:
        return Surface(*(np.zeros(shape, np.float32) for shape in ((0, 3), 0, 0, (0, 3))))
    scales = np.sort(scene.scales[pick], axis=1)
    area = np.pi * scales[:, 2] * scales[:, 1] * scene.opacities[pick] * (len(opaque) / len(pick))
    near_ones = _draw(opaque, LARGEST_TREE, rng)
    tree = neighbour_tree(scene.means[near_ones])
    points = scene.means[pick]
    near = near_ones[_nearest(tree, points, WIDTH_NEIGHBOURS)]
    width = np.median(scene.scales[near].max(axis=2), axis=1)
    haze = _draw(np.flatnonzero(scene.opacities < MAX_HAZE), LARGEST_TREE, rng)
    signs = _signs(scene, points[:SIGN_POINTS], near_ones[_nearest(tree, points[:SIGN_POINTS], SIGN_NEIGHBOURS)], haze)
    smooth = signs[_nearest(neighbour_tree(points[:SIGN_POINTS]), points, SMOOTH_NEIGHBOURS)].mean(axis=1)
    return Surface(points, np.maximum(width, 1e-9).astype(np.float32), area.astype(np.float32), smooth.astype(np.float32))


def neighbour_tree(points: FloatArray | Float32Array) -> cKDTree:
    """A tree of points (N, 3) that answers which are nearest to a place."""
    # SciPy's part is imported here, because it takes half of a command's start, and few commands look for neighbours.
    from scipy.spatial import cKDTree

    return cKDTree(points)


def _draw(index: NDArray[np.intp], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    return index if len(index) <= count else rng.choice(index, count, replace=False)


def _nearest(tree: cKDTree, points: Float32Array, count: int) -> NDArray[np.intp]:
    """Indices (N, K) of the nearest `count` points of the tree, or of all where it holds fewer."""
    _, near = tree.query(points, min(count, tree.n))
    return np.asarray(near, np.intp).reshape(len(points), -1)


def _signs(scene: GaussianScene, points: Float32Array, near: NDArray[np.intp], haze: NDArray[np.intp]) -> FloatArray:
    """The mean of three unit vectors (N, 3), each a sign of the side that `points` (N, 3) were seen from; `near` (N, K) are the
    opaque Gaussians around each, `haze` the faint ones anywhere.
    """
    away = points[:, None] - scene.means[near]
    size = np.log(np.maximum(scene.scales[near].max(axis=2), 1e-12))
    signs = _unit(np.einsum("nki,nk->ni", away, size - size.mean(axis=1, keepdims=True)))
    if scene.sh_degree > 0:
        base = SH_C0 * scene.sh[near, 0]
        contrast = base - base.mean(axis=1, keepdims=True)
        # Of degree 1, the coefficients go with -y, z and -x of the direction from the camera: turned round, y, -z and x.
        towards = scene.sh[near][:, :, [3, 1, 2]] * np.array([1, 1, -1], np.float32)[:, None]
        signs += _unit(np.einsum("nkic,nkc->ni", towards, contrast))
    if len(haze):
        to_haze = scene.means[haze[_nearest(neighbour_tree(scene.means[haze]), points, HAZE_NEIGHBOURS)]] - points[:, None]
        length = np.linalg.norm(to_haze, axis=2, keepdims=True)
        signs += _unit((to_haze / np.maximum(length, 1e-12)).sum(axis=1))
    return np.asarray(signs / 3)


def _unit(vectors: NDArray[np.floating]) -> FloatArray:
    """The directions of `vectors` (N, 3); zero where they have none."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.where(length > 1e-20, vectors / np.maximum(length, 1e-20), 0), np.float64)
