"""What the graphics card is given: a scan's numbers once, and for each view the Gaussians that it may show, front to back.

Numpy alone: fit for worker threads.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.geometry.camera import Intrinsics, Pose
from ...core.geometry.quaternion import rotations_of
from ...core.render import constants as c
from ...core.render.project import ascending_order
from ...core.splats.scene import GaussianScene

TABLE_WIDTH = 8192  # texels in a row of each table
CHUNK = 1 << 16  # Gaussians whose numbers are computed at a time
SHAPE_TEXELS = 3  # nine scaled axes, the logarithm of the opacity, and room for two numbers
# The next larger whole numbers are no float32 any more, and the numbers of Gaussians go to the shader as such.
MOST_GAUSSIANS = 1 << 24
# Rounding at the edge of an ellipse must not lose a pixel whose alpha reaches 1/255; in squared standard deviations.
CUT_MARGIN = 2e-3
# sqrt(2 ln 255 * 0.3) pixels: how far the low-pass filter alone can carry a Gaussian.
MAX_PIXEL_MARGIN = 1.9
IMAGE_BYTES = 100_000_000  # of the card, for the pictures of a view while it is drawn: 96 to a pixel


@dataclass(frozen=True, eq=False)
class ScanTexels:
    """N Gaussians of opacity >= 1/255. origin (3,) float64: added to `means` (N, 3) float32 gives the scan's coordinates;
    reach (N,): how far each can be seen from its centre, scene units. texels (N, per_gaussian, 4) float32: the axes of the
    Gaussian times their deviations as rows of a matrix, log opacity, two zeros; then SH, K times R, G and B, and zeros.
    """

    origin: np.ndarray
    means: np.ndarray
    reach: np.ndarray
    texels: np.ndarray
    coefficients: int
    antialiased: bool

    def __len__(self) -> int:
        return len(self.means)

    def sent(self) -> ScanTexels:
        """The same without the texels, once the graphics card has them."""
        return replace(self, texels=np.empty((0, *self.texels.shape[1:]), np.float32))


def texels_per_gaussian(coefficients: int) -> int:
    """Texels of one Gaussian with `coefficients` SH coefficients to a channel."""
    return SHAPE_TEXELS + -(-3 * coefficients // 4)


def gpu_bytes(gaussians: int, coefficients: int) -> int:
    """Memory of the graphics card that a scan takes: its own table, what one view projects of it, and the view itself."""
    return IMAGE_BYTES + 16 * gaussians * (texels_per_gaussian(coefficients) + 4)


def scan_texels(scene: GaussianScene) -> ScanTexels:
    """The tables of a scene."""
    keep = np.flatnonzero(scene.opacities >= np.float32(c.ALPHA_MIN))
    n, count = len(keep), scene.sh.shape[1]
    means = scene.means[keep]
    origin = np.median(means, axis=0).astype(np.float64) if n else np.zeros(3)
    texels = np.zeros((n, texels_per_gaussian(count), 4), np.float32)
    reach = np.empty(n, np.float32)
    flat = texels.reshape(n, 4 * texels.shape[1])
    for begin in range(0, n, CHUNK):
        part = slice(begin, begin + CHUNK)
        index = keep[part]
        scales, log_opacity = scene.scales[index], np.log(scene.opacities[index])
        flat[part, :9] = (rotations_of(scene.rotations[index]) * scales[:, None, :]).reshape(-1, 9)
        flat[part, 9] = log_opacity
        flat[part, 4 * SHAPE_TEXELS : 4 * SHAPE_TEXELS + 3 * count] = scene.sh[index].reshape(-1, 3 * count)
        cut = np.maximum(2 * (log_opacity - np.float32(np.log(c.ALPHA_MIN))), np.float32(0)) + np.float32(CUT_MARGIN)
        reach[part] = np.sqrt(cut) * scales.max(axis=1, initial=0.0)
        means[part] = means[part] - origin
    return ScanTexels(origin, means, reach, texels, count, scene.antialiased)


def seen_points(scan: ScanTexels, intrinsics: Intrinsics, pose: Pose, near: float) -> np.ndarray:
    """What of a scan may reach the image, (n, 4) float32, front to back: camera x, y, z and the Gaussian's number. Gaussians
    of equal depth keep the order of the file. They are culled by their extent, never by their centre alone.
    """
    out = np.empty((0, 4), np.float32)
    parts = [_seen(scan, slice(a, a + CHUNK), intrinsics, pose, near) for a in range(0, len(scan), CHUNK)]
    if parts:
        out = np.concatenate(parts)
    return out.take(ascending_order(np.ascontiguousarray(out[:, 2])), axis=0)


def _seen(scan: ScanTexels, part: slice, k: Intrinsics, pose: Pose, near: float) -> np.ndarray:
    exact = scan.means[part].astype(np.float64) @ pose.R.T
    exact += pose.R @ scan.origin + pose.t
    with np.errstate(over="ignore"):  # a camera so far away sees nothing
        points = exact.astype(np.float32)
    z = points[:, 2]
    kept = z > np.float32(near)
    for axis, (f, middle, size) in enumerate(((k.fx, k.cx, k.width), (k.fy, k.cy, k.height))):
        limit = max(middle, size - middle) / f + 0.5 * c.JACOBIAN_MARGIN * size / f
        gain = f * np.hypot(1.0, limit) * (1 + 1e-5)
        off = np.abs(np.float32(f) * points[:, axis] + np.float32(middle - 0.5 * size) * z)
        kept &= off <= np.float32(0.5 * size + MAX_PIXEL_MARGIN) * z + np.float32(gain) * scan.reach[part]
    index = np.flatnonzero(kept)
    out = np.empty((len(index), 4), np.float32)
    out[:, :3], out[:, 3] = points[index], index + part.start
    return out


def as_rows(texels: np.ndarray) -> np.ndarray:
    """Texels (n, 4) in rows of a table (H, TABLE_WIDTH, 4), zero beyond them."""
    table = np.zeros((-(-max(len(texels), 1) // TABLE_WIDTH) * TABLE_WIDTH, 4), np.float32)
    table[: len(texels)] = texels
    return table.reshape(-1, TABLE_WIDTH, 4)
