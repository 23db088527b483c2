"""From the engine's mesh to an object of the scene that is used as it should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ...core.geometry.camera import Camera
from ...core.proxy import ProxyMesh
from .objects import proxies_of

COLLECTION = "Proxies"
MATERIAL = "Proxy"
COLOR = "Color"
MOST_UVS = 8  # UV maps of a mesh that Blender takes


@dataclass(frozen=True)
class Made:
    """A mesh, and the cameras that it was made from."""

    mesh: ProxyMesh
    cameras: Sequence[Camera]


def put(scene: bpy.types.Scene, splat: bpy.types.Object, made: Made, use: str, replace: bool) -> bpy.types.Object:
    """The object of the new proxy; with `replace`, the splat's earlier one of the same use, which gets the new mesh."""
    data = _data(splat.name, made.mesh, made.cameras)
    earlier = [obj for obj in proxies_of(splat) if obj.gssmc.proxy_use == use and scene in obj.users_scene]
    if replace and earlier:
        return _exchanged(earlier[0], data)
    data.materials.append(_material())
    obj = bpy.data.objects.new(data.name, data)
    obj.gssmc.proxy_of, obj.gssmc.proxy_use = splat, use
    obj.parent, obj.matrix_parent_inverse = splat, Matrix.Identity(4)
    _collection(scene).objects.link(obj)
    _wear(obj, use)
    return obj


def _exchanged(obj: bpy.types.Object, data: bpy.types.Mesh) -> bpy.types.Object:
    before = obj.data
    for material in before.materials:
        data.materials.append(material)
    obj.data = data
    if before.users == 0:
        name = before.name
        bpy.data.meshes.remove(before)
        data.name = name
    return obj


def _data(splat: str, mesh: ProxyMesh, cameras: Sequence[Camera]) -> bpy.types.Mesh:
    data = bpy.data.meshes.new(f"{splat} Proxy")
    corners = mesh.faces.ravel().astype(np.int32)
    data.vertices.add(len(mesh.vertices))
    data.vertices.foreach_set("co", mesh.vertices.astype(np.float32).ravel())
    data.loops.add(len(corners))
    data.loops.foreach_set("vertex_index", corners)
    data.polygons.add(len(mesh.faces))
    data.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    data.update(calc_edges=True)
    colors = np.ones((len(mesh.colors), 4), np.float32)
    colors[:, :3] = np.where(mesh.colors <= 0.04045, mesh.colors / 12.92, ((mesh.colors + 0.055) / 1.055) ** 2.4)
    data.color_attributes.new(COLOR, "FLOAT_COLOR", "POINT").data.foreach_set("color", colors.ravel())
    for camera in cameras[:MOST_UVS]:
        uv = np.nan_to_num(mesh.uv(camera))[corners]
        data.uv_layers.new(name=camera.file, do_init=False).data.foreach_set("uv", uv.ravel())
    data.validate()
    return data


def _material() -> bpy.types.Material:
    """The colours of the scan, without gloss; made once for all proxies."""
    found = bpy.data.materials.get(MATERIAL)
    if found is not None:
        return found
    material = bpy.data.materials.new(MATERIAL)
    if material.node_tree is None:  # Before Blender 5 a new material has none.
        material.use_nodes = True
    nodes = material.node_tree.nodes
    surface = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    surface.inputs["Roughness"].default_value = 1.0
    color = nodes.new("ShaderNodeVertexColor")
    color.layer_name = COLOR
    color.location = surface.location.x - 250, surface.location.y
    material.node_tree.links.new(color.outputs["Color"], surface.inputs["Base Color"])
    return material


def _collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    for collection in scene.collection.children_recursive:
        if collection.name.split(".")[0] == COLLECTION and collection.library is None:
            return collection
    made = bpy.data.collections.new(COLLECTION)
    scene.collection.children.link(made)
    return made


def _wear(obj: bpy.types.Object, use: str) -> None:
    """Sets Blender's own switches as the use wants them."""
    obj.is_shadow_catcher = use == "SHADOW_CATCHER"
    obj.is_holdout = use == "HOLDOUT"
    obj.hide_render = use in ("COLLISION", "SNAP")
    obj.display_type = "WIRE" if obj.hide_render else "TEXTURED"
    if use == "COLLISION":
        obj.modifiers.new("Collision", "COLLISION")
