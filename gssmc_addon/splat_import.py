"""From the engine's scene to a splat object that stands, and shows, in a Blender scene."""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ..core import conventions
from ..core.conventions import Orientation
from ..core.splats.scene import GaussianScene
from . import splat_display, splat_object


def add_splat(context: bpy.types.Context, name: str, scene: GaussianScene, orientation: Orientation) -> bpy.types.Object:
    """A new splat object, turned upright, linked, active, and picked as the scene's splat."""
    obj = splat_object.create_splat(name, scene)
    if not splat_object.has_native_type(obj.data):
        splat_display.dress_splat(obj, scene)
    obj.matrix_world = Matrix(conventions.orientation_matrix(orientation).tolist())
    context.collection.objects.link(obj)
    for other in context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    context.scene.gssmc.splat = obj
    context.view_layer.update()
    return obj
