"""Which axis of its file a splat object shows upwards."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.geometry import conventions
from ...core.geometry.conventions import ORIENTATIONS, Orientation
from ..support.texts import n_

AXIS_WORDS = {"Y_DOWN": n_("Y Down"), "Y_UP": n_("Y Up"), "Z_UP": n_("Z Up"), "Z_DOWN": n_("Z Down")}
AXIS_ITEMS: tuple[tuple[str, str, str], ...] = (
    ("Y_DOWN", "Y Down", "The file's y axis points down, as photogrammetry and most splat trainers write it"),
    ("Y_UP", "Y Up", "The file's y axis points up"),
    ("Z_UP", "Z Up", "The file's z axis points up, as in Blender: keep the axes"),
    ("Z_DOWN", "Z Down", "The file's z axis points down"),
)


def of(splat: bpy.types.Object) -> Orientation:
    """What was chosen; for a splat of another importer the one of the four that its rotation is closest to."""
    if splat.gssmc.up_axis != "UNKNOWN":
        return splat.gssmc.up_axis
    turn = np.array(splat.matrix_world.to_quaternion().to_matrix())
    return max(ORIENTATIONS, key=lambda axis: float(np.trace(turn.T @ conventions.orientation_matrix(axis)[:3, :3])))
