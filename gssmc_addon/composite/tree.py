"""The compositor's nodes: the CG, bent by the photo's lens and shown by the artist's view transform, over the untouched plate.

The scene's own view transform becomes Standard, which gives a photo's pixels back as they were. The artist's goes onto the CG
alone, before both are laid over each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .look import Look, expose, show_as
from .nodes import Nodes
from .plate import Backplate

PLATE_Y, MAP_Y = 320, -320


@dataclass(frozen=True)
class Parts:
    """What the picture is made of: `map`: of the lens, None where it bends nothing; `look`: how the artist shows the CG;
    `by_depth`: what is nearer, CG or the render of the splat, hides the other.
    """

    plate: Backplate
    map: bpy.types.Image | None
    look: Look
    by_depth: bool = False


def build(scene: bpy.types.Scene, tree: bpy.types.NodeTree, parts: Parts) -> list[str]:
    """Makes the nodes. Returns sentences on what of the artist's look they cannot hold."""
    nodes = Nodes(scene, tree)
    layers = nodes.new("CompositorNodeRLayers", "CG")
    layers.scene, layers.layer = scene, layer_of(scene)
    # Blender 5.3 smears what Map UV takes straight from Render Layers, hence this node comes first, also where it does nothing.
    picture = expose(nodes, layers.outputs["Image"], parts.look)
    if parts.map is not None:
        picture = _bent(nodes, picture, parts.map)
    picture, notes = show_as(nodes, picture, parts.look)
    plate = _plate(nodes, parts.plate)
    if parts.by_depth:
        nodes.finish(_nearer(nodes, layers, picture, plate))
    else:
        nodes.finish(_over(nodes, picture, plate.outputs[0]))
    return notes


def _over(nodes: Nodes, picture: bpy.types.NodeSocket, plate: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    over = nodes.new("CompositorNodeAlphaOver", "CG over plate")
    back, front = [socket for socket in over.inputs if socket.type == "RGBA"]
    nodes.link(nodes.at_render_size(plate), back)
    nodes.link(picture, front)
    return over.outputs[0]


def _nearer(nodes: Nodes, layers: bpy.types.Node, picture: bpy.types.NodeSocket, splat: bpy.types.Node) -> bpy.types.NodeSocket:
    """CG and splat, each hidden where the other is nearer."""
    node = nodes.new("CompositorNodeZcombine", "The nearer one")
    pictures = [socket for socket in node.inputs if socket.type == "RGBA"]
    depths = [socket for socket in node.inputs if socket.type == "VALUE"]
    node.inputs["Use Alpha"].default_value = True
    for socket, source in zip(pictures, (picture, nodes.at_render_size(splat.outputs["Combined"])), strict=True):
        nodes.link(source, socket)
    for socket, source in zip(depths, (layers.outputs["Depth"], nodes.at_render_size(splat.outputs["Depth"])), strict=True):
        nodes.link(source, socket)
    return node.outputs[0]


def layer_of(scene: bpy.types.Scene) -> str:
    """The view layer that is rendered: the first one that is."""
    return next((layer.name for layer in scene.view_layers if layer.use), scene.view_layers[0].name)


def _bent(nodes: Nodes, picture: bpy.types.NodeSocket, where: bpy.types.Image) -> bpy.types.NodeSocket:
    shown = nodes.new("CompositorNodeImage", "Lens of the photo", MAP_Y)
    shown.image = where
    bend = nodes.then(picture, "CompositorNodeMapUV", "Bend")
    nodes.link(nodes.at_render_size(shown.outputs["Image"]), bend.inputs["UV"])
    return bend.outputs["Image"]


def _plate(nodes: Nodes, plate: Backplate) -> bpy.types.Node:
    """The node whose first output is the plate."""
    if plate.clip is not None:
        node = nodes.new("CompositorNodeMovieClip", "Plate", PLATE_Y)
        node.clip = plate.clip
        return node
    node = nodes.new("CompositorNodeImage", "Plate", PLATE_Y)
    node.image = plate.image
    if plate.frames:
        first, last = nodes.scene.gssmc.composite.frames_range
        node.frame_start, node.frame_offset, node.frame_duration = first, first - 1, last - first + 1
        node.use_auto_refresh = True
    elif plate.moves and plate.user is not None:
        node.frame_start, node.frame_offset = plate.user.frame_start, plate.user.frame_offset
        node.frame_duration = plate.user.frame_duration
        node.use_auto_refresh = True
    return node
