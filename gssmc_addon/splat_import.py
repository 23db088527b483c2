"""From a splat file to a splat object that stands, and shows, in a Blender scene."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import bpy
from mathutils import Matrix

from ..core import conventions
from ..core.conventions import Orientation
from ..core.errors import GssmcError
from ..core.splats import SUFFIXES, inspect_splats
from ..core.splats.scene import GaussianScene
from . import splat_display, splat_object

FILTER = ";".join(f"*{suffix}" for suffix in SUFFIXES)
AXIS_WORDS = {"Y_DOWN": "Y Down", "Y_UP": "Y Up", "Z_UP": "Z Up", "Z_DOWN": "Z Down"}


def describe(path: str) -> list[str]:
    """What the import dialog says of the chosen file: format, count and axes; or why it can't be imported.

    Reads the header only, hence fit for draw().
    """
    if not Path(path).is_file():
        return ["Choose a splat file: " + ", ".join(SUFFIXES)]
    try:
        info = inspect_splats(path)
    except GssmcError as error:
        return [str(error)]
    count = f"{info.count:,} Gaussians, SH degree {info.sh_degree}"
    return [f"Format: {info.format}", count, f"Its axes: {AXIS_WORDS[info.orientation]}"]


def add_splat(
    context: bpy.types.Context, name: str, scene: GaussianScene, orientation: Orientation | Literal["AUTO"]
) -> bpy.types.Object:
    """A new splat object, turned upright, linked, active, and picked as the scene's splat.

    `orientation` AUTO takes what the scene's format means, or its file declares.
    """
    axes = scene.orientation if orientation == "AUTO" else orientation
    obj = splat_object.create_splat(name, scene)
    if not splat_object.has_native_type(obj.data):
        splat_display.dress_splat(obj, scene)
    obj.matrix_world = Matrix(conventions.orientation_matrix(axes).tolist())
    context.collection.objects.link(obj)
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    context.scene.gssmc.splat = obj
    context.view_layer.update()
    return obj
