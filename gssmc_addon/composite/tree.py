"""The compositor's nodes: the CG, bent by the photo's lens and shown by the artist's view transform, over the untouched plate.

The scene's own view transform becomes Standard, which gives a photo's pixels back as they were. The artist's goes onto the CG
alone, before both are laid over each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from . import host
from .look import Look, expose, show_as
from .plate import Backplate

STEP_X, PLATE_Y, MAP_Y = 220, 320, -320


@dataclass(frozen=True)
class Parts:
    """What the picture is made of: `map`: of the lens, None where it bends nothing; `look`: how the artist shows the CG."""

    plate: Backplate
    map: bpy.types.Image | None
    look: Look


class Nodes:
    """Makes nodes from left to right in a tree of `scene`."""

    def __init__(self, scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
        self.scene, self.tree, self._x = scene, tree, -5 * STEP_X

    def new(self, kind: str, label: str, y: int = 0) -> bpy.types.Node:
        """A node of Blender's type `kind`."""
        node = self.tree.nodes.new(kind)
        self._place(node, y)
        node.label = label
        return node

    def then(self, before: bpy.types.NodeSocket, kind: str, label: str) -> bpy.types.Node:
        """The same, which takes `before` as its picture."""
        node = self.new(kind, label)
        self.link(before, node.inputs["Image"])
        return node

    def link(self, before: bpy.types.NodeSocket, after: bpy.types.NodeSocket) -> None:
        self.tree.links.new(before, after)

    def finish(self, picture: bpy.types.NodeSocket) -> None:
        """Makes `picture` what the render gives."""
        socket = host.output(self.tree, self.scene)
        self._place(socket.node, 0)
        self.link(picture, socket)

    def _place(self, node: bpy.types.Node, y: int) -> None:
        node.location = self._x, y
        self._x += STEP_X
        host.mark(self.scene, node)


def build(scene: bpy.types.Scene, tree: bpy.types.NodeTree, parts: Parts) -> list[str]:
    """Makes the nodes. Returns sentences on what of the artist's look they cannot hold."""
    nodes = Nodes(scene, tree)
    layers = nodes.new("CompositorNodeRLayers", "CG")
    layers.scene, layers.layer = scene, _layer(scene)
    # Blender 5.3 smears what Map UV takes straight from Render Layers, hence this node comes first, also where it does nothing.
    picture = expose(nodes, layers.outputs["Image"], parts.look)
    if parts.map is not None:
        picture = _bent(nodes, picture, parts.map)
    picture, notes = show_as(nodes, picture, parts.look)
    plate = _plate(nodes, parts.plate)
    over = nodes.new("CompositorNodeAlphaOver", "CG over plate")
    back, front = [socket for socket in over.inputs if socket.type == "RGBA"]
    nodes.link(plate, back)
    nodes.link(picture, front)
    nodes.finish(over.outputs[0])
    return notes


def _layer(scene: bpy.types.Scene) -> str:
    """The view layer that is rendered: the first one that is."""
    return next((layer.name for layer in scene.view_layers if layer.use), scene.view_layers[0].name)


def _bent(nodes: Nodes, picture: bpy.types.NodeSocket, where: bpy.types.Image) -> bpy.types.NodeSocket:
    shown = nodes.new("CompositorNodeImage", "Lens of the photo", MAP_Y)
    shown.image = where
    bend = nodes.then(picture, "CompositorNodeMapUV", "Bend")
    nodes.link(shown.outputs["Image"], bend.inputs["UV"])
    return bend.outputs["Image"]


def _plate(nodes: Nodes, plate: Backplate) -> bpy.types.NodeSocket:
    if plate.clip is not None:
        node = nodes.new("CompositorNodeMovieClip", "Plate", PLATE_Y)
        node.clip = plate.clip
        return node.outputs["Image"]
    node = nodes.new("CompositorNodeImage", "Plate", PLATE_Y)
    node.image = plate.image
    if plate.moves and plate.user is not None:
        node.frame_start, node.frame_offset = plate.user.frame_start, plate.user.frame_offset
        node.frame_duration = plate.user.frame_duration
        node.use_auto_refresh = True
    return node.outputs["Image"]
