"""Writing .spz, versions 2 and 3 (gzip)."""

from __future__ import annotations

import gzip
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...support.atomic import atomic_write
from ..ply.write import WRITE_ROWS, log_scales
from ..scene import Float32Array, GaussianScene, check_near
from ..turn import turned
from .payload import ANTIALIASED, HEADER, MAGIC, ORIENTATION
from .reader import COLOUR_FACTOR, SCALE_OFFSET, SCALE_STEPS

VERSIONS = (2, 3)
# Steps finer than 1e-6 would only take more room.
MAX_BITS = 20
LARGEST_POSITION = (1 << 23) - 1
COMPRESSION = 6
XYZW = np.array([1, 2, 3, 0])


def write_spz(path: str | Path, scene: GaussianScene, version: int = 3) -> None:
    """Write `scene`, y up as the format wants it; the file appears whole or not at all.

    Lossy: log scales within -10..6 to 1/16, colours and opacities to 1/255, SH within -1..1 to 1/128, rotations to 0.25
    degrees (version 2: 1.6, and 13 where w is near 0). Positions keep the most fractional bits that their range leaves of
    24, at most 20.
    Raises SplatFormatError when positions exceed 8388607 or the scene's axes can't be turned to the format's.
    """
    if version not in VERSIONS:
        raise SplatFormatError(f"Version {version} of .spz can't be written; take 2 or 3.")
    check_near(scene, ".spz")
    scene = turned(scene, ORIENTATION)
    reach = float(np.abs(scene.means).max(initial=0))
    if reach > LARGEST_POSITION:
        raise SplatFormatError(f"The scan reaches {reach:.3g} from its origin, too far for .spz; write it as .ply.")
    bits = MAX_BITS if reach == 0 else min(MAX_BITS, math.floor(math.log2(LARGEST_POSITION / reach)))
    header = HEADER.pack(MAGIC, version, len(scene), scene.sh_degree, bits, ANTIALIASED * scene.antialiased, 0)
    with atomic_write(path, "wb") as file, gzip.GzipFile(fileobj=file, mode="wb", compresslevel=COMPRESSION, mtime=0) as packed:
        packed.write(header)
        for block in _attributes(scene, version, bits):
            packed.write(block.tobytes())


def _attributes(scene: GaussianScene, version: int, bits: int) -> Iterator[NDArray[np.uint8]]:
    """Positions, opacities, colours, scales, rotations, SH; each of the whole scene before the next."""
    slices = [slice(start, start + WRITE_ROWS) for start in range(0, len(scene), WRITE_ROWS)]
    for at in slices:
        fixed = np.rint(scene.means[at].astype(np.float64) * 2.0**bits).astype("<i4")
        yield fixed.reshape(-1, 1).view(np.uint8)[:, :3]
    for at in slices:
        yield _byte(scene.opacities[at] * 255)
    for at in slices:
        yield _byte((scene.sh[at, 0] * COLOUR_FACTOR + 0.5) * 255)
    for at in slices:
        yield _byte((log_scales(scene.scales[at]) + SCALE_OFFSET) * SCALE_STEPS)
    for at in slices:
        yield _smallest_three(scene.rotations[at]) if version == 3 else _first_three(scene.rotations[at])
    for at in slices if scene.sh.shape[1] > 1 else ():
        yield _byte(scene.sh[at, 1:] * 128 + 128)


def _byte(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _first_three(rotations: Float32Array) -> NDArray[np.uint8]:
    sign = np.where(rotations[:, :1] < 0, -1, 1)
    return _byte((rotations[:, 1:] * sign + 1) * 127.5)


def _smallest_three(rotations: Float32Array) -> NDArray[np.uint8]:
    xyzw = rotations[:, XYZW]
    largest = np.abs(xyzw).argmax(axis=1)
    xyzw = xyzw * np.sign(np.take_along_axis(xyzw, largest[:, None], axis=1))
    packed: NDArray[np.uint32] = largest.astype(np.uint32)
    others = np.array([[i for i in range(4) if i != top] for top in range(4)])[largest]
    for column in range(3):
        value = np.take_along_axis(xyzw, others[:, column, None], axis=1)[:, 0]
        size = np.minimum(np.rint(np.abs(value) * (511 / math.sqrt(0.5))), 511).astype(np.uint32)
        packed = packed << np.uint32(10) | (value < 0).astype(np.uint32) << np.uint32(9) | size
    return packed.astype("<u4").reshape(-1, 1).view(np.uint8)
