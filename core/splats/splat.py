"""The .splat of web viewers: 32 bytes a Gaussian and nothing else, no header and no SH.

Each record: 3 float32 position, 3 float32 scale (linear), 4 uint8 colour and opacity (0..255), 4 uint8 quaternion w x y z
(128 is 0, 128 steps are 1). The converters leave positions as the .ply had them: y down.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SplatFormatError
from ..geometry.conventions import Orientation
from ..support.atomic import atomic_write
from .activate import SH_C0, SceneBuilder
from .format import Progress, SplatFormat, SplatInfo
from .scene import GaussianScene, check_near
from .turn import turned

NAME = "splat"
ORIENTATION: Orientation = "Y_DOWN"
RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("rotation", "u1", 4)])
CHUNK_ROWS = 1 << 14
# The bound on positions and scales, and the share of the first records of a file that must keep it.
CREDIBLE_LENGTH, CREDIBLE_SHARE = 1e12, 0.75
QUATERNION_LENGTHS = (0.9, 1.1)


def detect(header: bytes) -> bool:
    """Whether these first bytes are Gaussians: the format has no mark, but quaternions have length 1 and scales no sign."""
    records = np.frombuffer(header[: len(header) // RECORD.itemsize * RECORD.itemsize], RECORD)
    if not len(records):
        return False
    values = np.concatenate([records["mean"], records["scale"]], axis=1)
    length = np.linalg.norm(records["rotation"] / 128.0 - 1, axis=1)
    with np.errstate(invalid="ignore"):
        good = (np.abs(values) < CREDIBLE_LENGTH).all(axis=1) & (values[:, 3:] >= 0).all(axis=1)
    good &= (length > QUATERNION_LENGTHS[0]) & (length < QUATERNION_LENGTHS[1])
    return bool(good.mean() >= CREDIBLE_SHARE)


def inspect(path: str | Path) -> SplatInfo:
    """What the file's size says. Raises SplatFormatError when it is not that of whole records."""
    size = os.stat(path).st_size
    count, rest = divmod(size, RECORD.itemsize)
    if rest or not count:
        raise SplatFormatError(
            f"The .splat file has {size} bytes, no whole number of 32-byte records; it is cut off, so copy or export it again."
        )
    return SplatInfo(NAME, count, 0, ORIENTATION)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Gaussians with values that are not finite, a negative scale or a zero quaternion are left out and counted.
    Raises SplatFormatError, and OSError from the file system.
    """
    count = inspect(path).count
    builder = SceneBuilder(count, 1)
    with open(path, "rb") as file:
        while data := file.read(min(CHUNK_ROWS, count - builder.filled) * RECORD.itemsize):
            rows = np.frombuffer(data[: len(data) // RECORD.itemsize * RECORD.itemsize], RECORD)
            rgba = np.asarray(rows["rgba"].astype(np.float32) / 255, np.float32)
            sh = np.asarray((rgba[:, :3] - 0.5) / SH_C0, np.float32)[:, None]
            rotations = np.asarray(rows["rotation"].astype(np.float32) / 128 - 1, np.float32)
            builder.add_activated(rows["mean"], rows["scale"], rotations, rgba[:, 3], sh)
            if progress is not None:
                progress(builder.filled / count)
    return builder.scene(NAME, ORIENTATION)


def write_splat(path: str | Path, scene: GaussianScene) -> None:
    """Write `scene`, y down; the file appears whole or not at all.

    Lossy: SH above degree 0 is left out, colours and opacities keep 8 bits and lie within 0..1, rotations keep 0.5 degrees.
    Raises SplatFormatError when the scene's axes can't be turned to the format's.
    """
    check_near(scene, ".splat")
    scene = turned(scene, ORIENTATION)
    with atomic_write(path, "wb") as file:
        for start in range(0, len(scene), CHUNK_ROWS):
            file.write(_records(scene, slice(start, start + CHUNK_ROWS)).tobytes())


def _records(scene: GaussianScene, at: slice) -> NDArray[np.void]:
    records = np.empty(len(scene.means[at]), RECORD)
    records["mean"], records["scale"] = scene.means[at], scene.scales[at]
    rgba = np.concatenate([scene.sh[at, 0] * SH_C0 + 0.5, scene.opacities[at, None]], axis=1)
    records["rgba"] = np.clip(np.rint(rgba * 255), 0, 255)
    records["rotation"] = np.clip(np.rint(scene.rotations[at] * 128 + 128), 0, 255)
    return records


FORMAT = SplatFormat(NAME, ".splat", ORIENTATION, detect, inspect, read)
