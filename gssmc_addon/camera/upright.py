"""Another axis of a splat's file points up: the splat is turned, and the cameras of its photos with it."""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ...core.geometry import conventions
from ...core.geometry.conventions import Orientation
from ..splat import up_axis
from . import together


def change(scene: bpy.types.Scene, splat: bpy.types.Object, axis: Orientation) -> int:
    """Turns the splat about its origin so that `axis` points up, and the cameras of photos with it; how many these are.

    What the user has done to the object besides is kept. Raises SplatFormatError or CameraError, with nothing changed, when
    something else moves the splat or a camera.
    """
    turn = conventions.orientation_matrix(up_axis.of(splat)).T @ conventions.orientation_matrix(axis)
    before = splat.matrix_world.copy()
    after = before @ Matrix(turn.tolist())
    count = together.move(scene, splat, after @ before.inverted())
    splat.gssmc.up_axis = axis
    return count
