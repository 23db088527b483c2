"""Makes compositor nodes side by side, from left to right."""

from __future__ import annotations

import bpy

from . import host

STEP_X = 220


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

    def at_render_size(self, picture: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """The picture as large as the render, which a percentage makes smaller than the photo."""
        node = self.then(picture, "CompositorNodeScale", "Size of the render")
        if "Type" in node.inputs:  # from 5.0 on
            node.inputs["Type"].default_value, node.inputs["Frame Type"].default_value = "Render Size", "Stretch"
        else:
            node.space, node.frame_method = "RENDER_SIZE", "STRETCH"
        return node.outputs["Image"]

    def finish(self, picture: bpy.types.NodeSocket) -> None:
        """Makes `picture` what the render gives."""
        socket = host.output(self.tree, self.scene)
        self._place(socket.node, 0)
        self.link(picture, socket)

    def _place(self, node: bpy.types.Node, y: int) -> None:
        node.location = self._x, y
        self._x += STEP_X
        host.mark(self.scene, node)
