"""The look of a splat object where its Gaussians are not drawn (see viewport): coloured points as large as the Gaussians.

Only a look: nothing here is read back. A material turns the splats' base colour into light, so that Material Preview and
Rendered show the scan; `radius` gives the points their size.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...core.splats.scene import GaussianScene
from .object import BASE

MATERIAL = "GS-SMC Splat Colour"
SH_C0 = 0.28209479177387814
DISPLAY_GAMMA = 2.2  # Splat colours are display-encoded, while an emission shader takes linear light.
RADIUS_SIGMAS = 1.2
LARGEST_SHOWN = 0.98  # A quantile: the few huge Gaussians of a far background would hide what lies behind them.
MIN_SHOWN_OPACITY = 0.1  # Drawn as points, Gaussians of low opacity would look like solid balls.


def point_radius(scene: GaussianScene) -> np.ndarray:
    """Sizes of the points (N,), in the object's units. Needs no Blender, hence fit for a worker thread."""
    radius = np.sqrt(np.sort(scene.scales, axis=1)[:, 1:].prod(axis=1)) * RADIUS_SIGMAS * np.sqrt(scene.opacities)
    np.minimum(radius, np.quantile(radius, LARGEST_SHOWN), out=radius)
    radius[scene.opacities < MIN_SHOWN_OPACITY] = 0.0
    return radius.astype(np.float32)


def dress_splat(cloud: bpy.types.PointCloud, radius: np.ndarray) -> None:
    """Gives the point cloud its point sizes and its material."""
    attribute = cloud.attributes.get("radius") or cloud.attributes.new("radius", "FLOAT", "POINT")
    attribute.data.foreach_set("value", radius)
    cloud.materials.append(bpy.data.materials.get(MATERIAL) or _new_material())


def undress(cloud: bpy.types.PointCloud) -> None:
    """Takes the material away again: where Blender draws the splats, it would change their colours."""
    for index, material in reversed(list(enumerate(cloud.materials))):
        if material is not None and material.name == MATERIAL:
            cloud.materials.pop(index=index)


def _new_material() -> bpy.types.Material:
    material = bpy.data.materials.new(MATERIAL)
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = BASE
    scale = _vector_math(tree, "MULTIPLY_ADD", attribute.outputs["Vector"], (SH_C0,) * 3, (0.5,) * 3)
    clamp = _vector_math(tree, "MAXIMUM", scale.outputs[0], (0.0,) * 3)
    gamma = tree.nodes.new("ShaderNodeGamma")
    gamma.inputs["Gamma"].default_value = DISPLAY_GAMMA
    emission = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(clamp.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    for x, node in enumerate((attribute, scale, clamp, gamma, emission, output)):
        node.location = (200 * x, 0)
    return material


def _vector_math(
    tree: bpy.types.NodeTree, operation: str, source: bpy.types.NodeSocket, *values: tuple[float, ...]
) -> bpy.types.Node:
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    tree.links.new(source, node.inputs[0])
    for index, value in enumerate(values, start=1):
        node.inputs[index].default_value = value
    return node


def show_colours(context: bpy.types.Context) -> None:
    """Switches the window's Solid viewports to Material Preview; Solid mode shows a point cloud in grey."""
    screen = context.screen
    for area in screen.areas if screen else ():
        if area.type == "VIEW_3D" and area.spaces.active.shading.type in {"SOLID", "WIREFRAME"}:
            area.spaces.active.shading.type = "MATERIAL"
