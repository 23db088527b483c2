"""Flat Gaussians (2DGS): the INRIA layout with two scales. The third axis of the rotation is the disc's normal.

2DGS draws discs without thickness. Here the third scale is a thousandth of the smaller of the two, so that every tool that
takes logarithms of scales can handle the scene; a thousandth of a disc is far below what a pixel shows of it.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ...errors import SplatFormatError
from ...support.words import counted
from ..format import Progress, SplatFormat, SplatInfo
from ..scene import Float32Array, GaussianScene
from ..turn import turned
from .layout import ORIENTATION, PlyLayout, header_names, inspect_layout, read_layout
from .reader import GEOMETRY
from .write import Precision, property_names, raw_rows, write_rows

# The third scale of a disc, as a share of its smaller scale.
THICKNESS = 1e-3
# A Gaussian that is no thicker than this share can be written as a disc.
MAX_THICKNESS = 1e-2


def _with_third_scale(rows: Float32Array) -> Float32Array:
    third = np.minimum(rows[:, 3], rows[:, 4]) + np.float32(math.log(THICKNESS))
    return np.asarray(np.insert(rows, 5, third, axis=1))


LAYOUT = PlyLayout("2DGS ply", tuple(name for name in GEOMETRY if name != "scale_2"), _with_third_scale)


def detect(header: bytes) -> bool:
    """Whether these first bytes are of a splat .ply with exactly the scales 0 and 1."""
    names = header_names(header)
    return {"scale_0", "scale_1", "rot_0", "opacity"} <= names and "scale_2" not in names


def inspect(path: str | Path) -> SplatInfo:
    """What the header says. Raises SplatFormatError."""
    return inspect_layout(Path(path), LAYOUT)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file, each disc with a third scale of THICKNESS times its smaller one. Errors as in ply.read."""
    return read_layout(Path(path), LAYOUT, progress)


def write_2dgs(path: str | Path, scene: GaussianScene, precision: Precision = "float") -> None:
    """Write a scene of discs; their third scale is left out. The file appears whole or not at all.

    Raises SplatFormatError when a Gaussian is thicker along its third axis than MAX_THICKNESS times its other scales.
    """
    scene = turned(scene, ORIENTATION)
    thick = int((scene.scales[:, 2] > MAX_THICKNESS * scene.scales[:, :2].min(axis=1)).sum())
    if thick:
        raise SplatFormatError(
            f"Not flat along the third axis: {thick} of {counted(len(scene), 'Gaussian')}; write a plain .ply."
        )
    write_rows(path, scene, property_names(scene, 2), lambda at: raw_rows(scene, at, 2), precision)


FORMAT = SplatFormat(LAYOUT.name, ".ply", ORIENTATION, detect, inspect, read)
