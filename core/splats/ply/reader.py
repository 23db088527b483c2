"""Gaussian splats in the INRIA PLY layout: SH degree 0-3, binary (little, big endian) and ascii, any property order and
number type (half, float, double).
"""

from __future__ import annotations

from pathlib import Path

from ..format import Progress, SplatFormat, SplatInfo
from ..scene import GaussianScene
from ..turn import turned
from .layout import MARKS, ORIENTATION, PlyLayout, inspect_layout, read_layout
from .write import Precision, property_names, raw_rows, write_rows

GEOMETRY = ("x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity")
LAYOUT = PlyLayout("ply", GEOMETRY)


def detect(header: bytes) -> bool:
    """Whether a file that begins with these bytes is a PLY of any kind; the other layouts are asked before this one."""
    return header.startswith(MARKS)


def inspect(path: str | Path) -> SplatInfo:
    """What the header says. Raises SplatFormatError when it is no Gaussian splat's."""
    return inspect_layout(Path(path), LAYOUT)


def read(path: str | Path, progress: Progress | None = None) -> GaussianScene:
    """The scene in the file, activated: exp for scales, sigmoid for opacities, unit quaternions.

    `progress` is called with a fraction 0..1 and may raise to stop the reading. Gaussians with NaN, infinite values or a
    zero quaternion are left out and counted in `dropped`. Raises SplatFormatError, and OSError from the file system.
    """
    return read_layout(Path(path), LAYOUT, progress)


def write_ply(path: str | Path, scene: GaussianScene, precision: Precision = "float") -> None:
    """Write `scene` in the INRIA layout, binary little endian, y down; the file appears whole or not at all.

    Opacities of exactly 0 or 1 and scales of 0 are moved to the nearest value with a finite logit or logarithm.
    Raises SplatFormatError when the scene's axes can't be turned to the layout's.
    """
    write_ply_axes_kept(path, turned(scene, ORIENTATION), precision)


def write_ply_axes_kept(path: str | Path, scene: GaussianScene, precision: Precision = "float") -> None:
    """As `write_ply`, whichever way the scene's axes point; the layout has no place to tell readers."""
    write_rows(path, scene, property_names(scene), lambda at: raw_rows(scene, at), precision)


FORMAT = SplatFormat(LAYOUT.name, ".ply", ORIENTATION, detect, inspect, read)
