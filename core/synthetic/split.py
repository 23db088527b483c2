"""A scan as one that was trained to finer detail: each Gaussian as several smaller ones that together look like it.

Along an axis of deviation s, k Gaussians of deviation w s stand 2 w s apart. With peaks that follow a Gaussian of deviation
s sqrt(1 - w^2), their sum is a Gaussian of deviation s to a few per cent, because the convolution of the two is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..geometry.quaternion import rotations_of
from ..splats.scene import GaussianScene

# Deviations between the outermost of the parts along an axis, which a Gaussian's visible extent exceeds little.
SPAN = 4.2
MOST_OPAQUE = 0.999
LOW_PASS = 0.3  # pixels^2, what a renderer adds to each variance
# Gaussians that are split at once.
BLOCK = 1 << 14


def split_scene(scene: GaussianScene, parts: tuple[int, int], pixel: float) -> GaussianScene:
    """Each Gaussian as parts[0] x parts[1] smaller ones along its longest and its second axis, in its place and colour.

    `pixel`, scene units: the width of a pixel of the pictures in which both scans are to look alike. The low-pass filter of
    the renderer makes the small ones of them wider without making them fainter, which their opacities make up for.
    """
    blocks = [slice(begin, begin + BLOCK) for begin in range(0, len(scene), BLOCK)]
    geometry = [np.concatenate(column) for column in zip(*_split(scene, blocks, parts, pixel), strict=True)]
    means, scales, opacities = geometry
    count = parts[0] * parts[1]
    rotations, sh = (np.repeat(array, count, axis=0) for array in (scene.rotations, scene.sh))
    return GaussianScene(means, scales, rotations, opacities, sh, antialiased=scene.antialiased)


def _split(
    scene: GaussianScene, blocks: list[slice], parts: tuple[int, int], pixel: float
) -> Iterator[tuple[NDArray[np.float32], ...]]:
    """Means (m, 3), scales (m, 3) and opacities (m,) of the parts of each block."""
    for block in blocks:
        scales = scene.scales[block].astype(np.float64)
        order = np.argsort(-scales, axis=1)[:, :2]
        rows = np.arange(len(scales))[:, None]
        offsets = np.zeros((len(scales), parts[0], parts[1], 3))
        faint = np.ones((len(scales), parts[0], parts[1]))
        overlap = np.ones(len(scales))
        small = scales.copy()
        for axis, count in enumerate(parts):
            width = 1.0 if count == 1 else SPAN / (2 * (count - 1))
            places = (np.arange(count) - (count - 1) / 2) * 2 * width
            along = scales[rows, order[:, axis : axis + 1]][:, 0]
            shape = (1, count, 1) if axis == 0 else (1, 1, count)
            offset = (along[:, None] * places).reshape(len(scales), *shape[1:])
            np.put_along_axis(offsets, order[:, None, None, axis : axis + 1], offset[..., None], axis=3) if False else None
            for a in range(3):
                offsets[..., a] += np.where(order[:, axis, None, None] == a, offset, 0)
            seen = along**2 + LOW_PASS * pixel**2
            faint *= np.exp(-0.5 * offset**2 / seen[:, None, None])
            small[rows[:, 0], order[:, axis]] *= width
            each = (width * along) ** 2 + LOW_PASS * pixel**2
            steps = np.arange(1 - count, count)
            overlap *= np.minimum(np.exp(-0.5 * (2 * width * along[:, None] * steps) ** 2 / each[:, None]).sum(axis=1), count)
        wanted = np.minimum(scene.opacities[block].astype(np.float64), MOST_OPAQUE)[:, None, None] * faint
        opacities = 1 - (1 - wanted) ** (1 / overlap[:, None, None])
        R = rotations_of(scene.rotations[block])
        means = scene.means[block][:, None, None] + np.einsum("nij,nklj->nkli", R, offsets)
        count = parts[0] * parts[1]
        yield (
            means.reshape(-1, 3).astype(np.float32),
            np.repeat(small, count, axis=0).astype(np.float32),
            opacities.reshape(-1).astype(np.float32),
        )
