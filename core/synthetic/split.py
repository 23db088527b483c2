"""A scan as one that was trained to finer detail: each Gaussian as several smaller ones that together look like it.

Along an axis of deviation s, k Gaussians of deviation w s stand 2 w s apart. Their sum, with peaks that follow the Gaussian
itself, is that Gaussian to a few per cent. Where they overlap, light passes all of them, so that their opacities are those
whose transmittances multiply to that of the one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.quaternion import rotations_of
from ..splats.scene import GaussianScene

FloatArray = NDArray[np.float64]

# Deviations between the outermost of the parts along an axis, which a Gaussian's visible extent exceeds little.
SPAN = 4.2
FEWEST = 4  # parts along an axis; fewer do not reach so far
MOST_OPAQUE = 0.999
LOW_PASS = 0.3  # pixels^2, what a renderer adds to each variance
# Gaussians that are split at once.
BLOCK = 1 << 14


def split_scene(scene: GaussianScene, parts: tuple[int, int], pixel: float) -> GaussianScene:
    """Each Gaussian as parts[0] x parts[1] smaller ones along its longest and its second axis, in its place and colour; either
    1 or at least FEWEST.

    `pixel`, scene units: the width of a pixel of the pictures in which both scans are to look alike. The low-pass filter of
    the renderer makes the small ones of them wider without making them fainter, which their opacities make up for.
    """
    assert all(count == 1 or count >= FEWEST for count in parts), "so few parts do not make up a Gaussian"
    count = parts[0] * parts[1]
    means, scales = np.empty((count * len(scene), 3), np.float32), np.empty((count * len(scene), 3), np.float32)
    opacities = np.empty(count * len(scene), np.float32)
    for begin in range(0, len(scene), BLOCK):
        some, room = slice(begin, begin + BLOCK), slice(count * begin, count * (begin + BLOCK))
        means[room], scales[room], opacities[room] = _split(scene, some, parts, pixel)
    rotations, sh = (np.repeat(array, count, axis=0) for array in (scene.rotations, scene.sh))
    return GaussianScene(means, scales, rotations, opacities, sh, antialiased=scene.antialiased)


@dataclass(frozen=True, eq=False)
class _Along:
    """n Gaussians split along one axis: the parts' places (n, k) and deviations (n,), scene units; peak (n, k) of each part
    where the whole one has 1; overlap (n,): how many parts there are in one place, as pictures of that pixel show them.
    """

    places: FloatArray
    deviation: FloatArray
    peak: FloatArray
    overlap: FloatArray

    @classmethod
    def of(cls, deviation: FloatArray, count: int, pixel: float) -> _Along:
        if count == 1:
            one = np.ones(len(deviation))
            return cls(0 * one[:, None], deviation, one[:, None], one)
        low, width = LOW_PASS * pixel**2, SPAN / (2 * (count - 1))
        places = deviation[:, None] * (2 * width * (np.arange(count) - (count - 1) / 2))
        small = width * deviation
        apart = 2 * small[:, None] * np.arange(1 - count, count)
        overlap = np.exp(-0.5 * apart**2 / (small**2 + low)[:, None]).sum(axis=1)
        peak = np.exp(-0.5 * places**2 / (deviation**2 + low)[:, None])
        return cls(places, small, peak, np.minimum(overlap, count))


def _split(scene: GaussianScene, some: slice, parts: tuple[int, int], pixel: float) -> tuple[FloatArray, ...]:
    """Means (m, 3), scales (m, 3) and opacities (m,) of the parts of some Gaussians."""
    scales = scene.scales[some].astype(np.float64)
    rows, axes = np.arange(len(scales)), np.argsort(-scales, axis=1)[:, :2].T
    first, second = (_Along.of(scales[rows, axis], count, pixel) for axis, count in zip(axes, parts, strict=True))
    offsets = np.zeros((len(scales), *parts, 3))
    unit = np.eye(3)
    offsets += first.places[:, :, None, None] * unit[axes[0]][:, None, None]
    offsets += second.places[:, None, :, None] * unit[axes[1]][:, None, None]
    scales[rows, axes[0]], scales[rows, axes[1]] = first.deviation, second.deviation
    means = scene.means[some][:, None, None] + np.einsum("nij,nklj->nkli", rotations_of(scene.rotations[some]), offsets)
    whole = np.minimum(scene.opacities[some].astype(np.float64), MOST_OPAQUE)[:, None, None]
    wanted = whole * first.peak[:, :, None] * second.peak[:, None, :]
    opacities = 1 - (1 - wanted) ** (1 / (first.overlap * second.overlap))[:, None, None]
    return means.reshape(-1, 3), np.repeat(scales, parts[0] * parts[1], axis=0), opacities.reshape(-1)
