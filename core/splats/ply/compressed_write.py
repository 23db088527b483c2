"""Writing SuperSplat's compressed .ply: Gaussians in Morton order, so that a chunk's bounds are small and its steps fine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...support.atomic import atomic_write
from ..activate import SH_C0
from ..scene import Float32Array, GaussianScene, check_near
from ..turn import turned
from .compressed import BLOCK, CHUNK, COLOUR_BOUNDS, LARGEST_FIRST, PACKED, POSITION_BOUNDS, SCALE_BOUNDS, SH_RANGE
from .layout import ORIENTATION
from .write import log_scales

# Bits of each axis in the Morton code.
MORTON_BITS = 10
# Other writers of this format clamp log scales to these limits.
SCALE_LIMITS = (-20.0, 20.0)


def write_compressed(path: str | Path, scene: GaussianScene) -> None:
    """Write `scene`, in another order; the file appears whole or not at all.

    Lossy: positions and log scales to 1/2047 (y: 1/1023) of a chunk's extent, rotations to 0.1 degrees, SH to 1/32 within
    -4..4. Raises SplatFormatError when the scene's axes can't be turned to the layout's.
    """
    check_near(scene, "a compressed .ply")
    scene = turned(scene, ORIENTATION)
    order = morton_order(scene.means)
    with atomic_write(path, "wb") as file:
        file.write(_header(scene).encode("ascii"))
        for at in _blocks(order):
            file.write(np.concatenate([_bounds(values) for values in _values(scene, at)], axis=1).astype("<f4").tobytes())
        for at in _blocks(order):
            file.write(_packed(scene, at).astype("<u4").tobytes())
        for at in _blocks(order) if scene.sh.shape[1] > 1 else ():
            rest = scene.sh[at, 1:].transpose(0, 2, 1).reshape(len(at), -1)
            file.write(np.clip((rest / SH_RANGE + 0.5) * 256, 0, 255).astype(np.uint8).tobytes())


def morton_order(means: Float32Array) -> NDArray[np.intp]:
    """The order of points (N, 3) along a Z curve through their bounding box."""
    low, high = means.min(axis=0), means.max(axis=0)
    cells = ((means - low) / np.maximum(high - low, np.finfo(np.float32).tiny) * ((1 << MORTON_BITS) - 1)).astype(np.uint32)
    code = np.zeros(len(means), np.uint32)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _header(scene: GaussianScene) -> str:
    n, rest = len(scene), 3 * (scene.sh.shape[1] - 1)
    lines = ["ply", "format binary_little_endian 1.0", f"element chunk {math.ceil(n / CHUNK)}"]
    lines += [f"property float {name}" for name in (*POSITION_BOUNDS, *SCALE_BOUNDS, *COLOUR_BOUNDS)]
    lines += [f"element vertex {n}", *(f"property uint {name}" for name in PACKED)]
    if rest:
        lines += [f"element sh {n}", *(f"property uchar f_rest_{i}" for i in range(rest))]
    return "\n".join([*lines, "end_header", ""])


def _blocks(order: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    for start in range(0, len(order), BLOCK):
        yield order[start : start + BLOCK]


def _values(scene: GaussianScene, at: NDArray[np.intp]) -> tuple[Float32Array, Float32Array, Float32Array]:
    """What lies between bounds: positions, log scales, colours; (n, 3) each."""
    scales = np.clip(log_scales(scene.scales[at]), *SCALE_LIMITS).astype(np.float32)
    return scene.means[at], scales, scene.sh[at, 0] * np.float32(SH_C0) + np.float32(0.5)


def _bounds(values: Float32Array) -> Float32Array:
    """Minima and maxima (chunks, 6) of (n, 3) values."""
    starts = np.arange(0, len(values), CHUNK)
    return np.concatenate([np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)], axis=1)


def _packed(scene: GaussianScene, at: NDArray[np.intp]) -> NDArray[np.uint32]:
    chunk = np.arange(len(at)) // CHUNK
    shares = []
    for values in _values(scene, at):
        bounds = _bounds(values)[chunk]
        extent = bounds[:, 3:] - bounds[:, :3]
        shares.append(np.asarray((values - bounds[:, :3]) / np.where(extent > 0, extent, 1), np.float32))
    position, scale, colour = shares
    rgba = np.concatenate([colour, scene.opacities[at, None]], axis=1)
    columns = [_pack(position, (11, 10, 11)), _pack_rotation(scene.rotations[at]), _pack(scale, (11, 10, 11))]
    return np.stack([*columns, _pack(rgba, (8, 8, 8, 8))], axis=1)


def _pack(shares: Float32Array, bits: tuple[int, ...]) -> NDArray[np.uint32]:
    """Fractions 0..1 (n, len(bits)) to one number, the first in the highest bits."""
    out = np.zeros(len(shares), np.uint32)
    for column, width in enumerate(bits):
        full = (1 << width) - 1
        out = out << width | np.clip(shares[:, column] * full + 0.5, 0, full).astype(np.uint32)
    return out


def _pack_rotation(rotations: Float32Array) -> NDArray[np.uint32]:
    largest = np.abs(rotations).argmax(axis=1)
    top = np.take_along_axis(rotations, largest[:, None], axis=1)
    others = np.argsort(LARGEST_FIRST, axis=1)[largest][:, 1:]
    shares = np.take_along_axis(rotations * np.sign(top), others, axis=1) * np.float32(math.sqrt(0.5)) + np.float32(0.5)
    return np.asarray(largest.astype(np.uint32) << 30 | _pack(shares, (10, 10, 10)))
