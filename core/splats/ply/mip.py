"""Mip-Splatting's .ply: the INRIA layout and `filter_3D`, each Gaussian's smoothing kernel, not yet applied to it.

With the file's scales s and opacity o, the Gaussian to draw is the convolution: scales sqrt(s^2 + f^2), opacity
o sqrt(prod s^2 / prod (s^2 + f^2)), f the filter's standard deviation in scene units. The scene holds that Gaussian.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import SplatFormatError
from ...support.words import counted
from ..format import Progress, SplatFormat, SplatInfo
from ..scene import Float32Array, GaussianScene
from ..turn import turned
from .layout import ORIENTATION, PlyLayout, header_names, inspect_layout, read_layout
from .reader import GEOMETRY
from .write import Precision, property_names, raw_rows, write_rows

FILTER = "filter_3D"
AT = len(GEOMETRY)
# Opacities are kept between these, so that they have a logit.
NEAREST_TO_ZERO, NEAREST_TO_ONE = 1e-300, 1 - 1e-16


def _apply_filter(rows: Float32Array) -> Float32Array:
    variance, added = np.exp(2 * rows[:, 3:6].astype(np.float64)), rows[:, AT, None].astype(np.float64) ** 2
    with np.errstate(divide="ignore"):
        opacity = np.sqrt(np.prod(variance / (variance + added), axis=1)) / (1 + np.exp(-rows[:, 10].astype(np.float64)))
        opacity = np.clip(opacity, NEAREST_TO_ZERO, NEAREST_TO_ONE)
        out = np.delete(rows, AT, axis=1)
        out[:, 3:6] = 0.5 * np.log(variance + added)
        out[:, 10] = np.where(np.isnan(rows[:, 10]), np.nan, np.log(opacity / (1 - opacity)))
    return np.asarray(out)


LAYOUT = PlyLayout("Mip-Splatting ply", (*GEOMETRY, FILTER), _apply_filter)


def detect(header: bytes) -> bool:
    """Whether these first bytes are of a .ply with Mip-Splatting's filter."""
    return FILTER in header_names(header)


def inspect(path: str | Path) -> SplatInfo:
    """What the header says. Raises SplatFormatError."""
    return inspect_layout(Path(path), LAYOUT)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file, the filter applied. Errors as in ply.read."""
    return read_layout(Path(path), LAYOUT, progress)


def write_mip(path: str | Path, scene: GaussianScene, filter_3d: NDArray[np.floating], precision: Precision = "float") -> None:
    """Write `scene` as what it is before the filters `filter_3d` (N,), scene units, are applied: the inverse of `read`.

    The file appears whole or not at all. Raises SplatFormatError when a filter is as wide as its Gaussian, or the opacity
    without it exceeds 1.
    """
    scene = turned(scene, ORIENTATION)
    variance, added = scene.scales.astype(np.float64) ** 2, np.asarray(filter_3d, np.float64)[:, None] ** 2
    bare = variance - added
    with np.errstate(invalid="ignore", divide="ignore"):
        opacity = scene.opacities * np.sqrt(np.prod(variance / bare, axis=1))
    wrong = int((~(bare > 0).all(axis=1) | ~(opacity <= 1)).sum())
    if wrong:
        raise SplatFormatError(
            f"Too small for the 3D filter: {wrong} of {counted(len(scene), 'Gaussian')}; give smaller filters."
        )
    parts = (scene.means, np.sqrt(bare).astype(np.float32), scene.rotations, opacity.astype(np.float32), scene.sh)
    plain = GaussianScene(*parts, antialiased=scene.antialiased, origin=scene.origin)
    column = np.asarray(filter_3d, np.float64)[:, None]
    names = property_names(plain, extra=(FILTER,))
    write_rows(path, plain, names, lambda at: np.concatenate([raw_rows(plain, at), column[at]], axis=1), precision)


FORMAT = SplatFormat(LAYOUT.name, ".ply", ORIENTATION, detect, inspect, read)
