"""Where a scene's compositor nodes live, which three lines of Blender say in three ways.

Up to 4.5 the scene has one tree of its own: ours are added to the user's nodes, and our output is the active one. From 5.0 on
the scene points at a node group: ours takes its place. From 5.3 on it has a list of effects: the user's are switched off.
"""

from __future__ import annotations

import json

import bpy

from .state import GssmcComposite

NAME = "GS-SMC Composite"
MADE = "gssmc_composite"  # a custom property of the nodes that were made in the user's own tree


def has_effects(scene: bpy.types.Scene) -> bool:
    """Whether this Blender keeps a list of compositor effects."""
    return "compositor_effects" in scene.bl_rna.properties


def has_group(scene: bpy.types.Scene) -> bool:
    """Whether this Blender has compositor nodes in node groups of their own."""
    return "compositing_node_group" in scene.bl_rna.properties


def begin(scene: bpy.types.Scene, kept: GssmcComposite) -> bpy.types.NodeTree:
    """The tree to make nodes in, whose output is the render's; what was there is noted in `kept`."""
    if has_effects(scene):
        effects = scene.compositor_effects
        kept.host = json.dumps([[effect.name, effect.enable_for_render, effect.is_active] for effect in effects])
        for effect in effects:
            effect.enable_for_render = False
        kept.tree = _new_group()
        ours = effects.new(name=NAME)
        ours.node_group, ours.enable_for_render = kept.tree, True
        return kept.tree
    if has_group(scene):
        kept.own_tree, kept.tree = scene.compositing_node_group, _new_group()
        scene.compositing_node_group = kept.tree
        return kept.tree
    kept.host = json.dumps({"use_nodes": scene.use_nodes})
    scene.use_nodes = True  # The first time, Blender makes the tree with its two usual nodes.
    active = scene.node_tree.nodes.active
    kept.host = json.dumps(json.loads(kept.host) | {"active": active.name if active else "", "output": _output_of(scene)})
    return scene.node_tree


def output(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> bpy.types.NodeSocket:
    """The socket that takes the finished picture, made anew in the tree that `begin` gave."""
    if has_group(scene):
        return tree.nodes.new("NodeGroupOutput").inputs[0]
    node = tree.nodes.new("CompositorNodeComposite")
    tree.nodes.active = node  # Of several Composite nodes, Blender takes the active one.
    return node.inputs["Image"]


def mark(scene: bpy.types.Scene, node: bpy.types.Node) -> None:
    """Notes that the node was made for the composite."""
    if not has_group(scene):
        node[MADE] = True


def end(scene: bpy.types.Scene, kept: GssmcComposite) -> None:
    """Removes what was made and puts the user's compositor back."""
    if has_effects(scene):
        _end_effects(scene, kept)
    elif has_group(scene):
        if scene.compositing_node_group == kept.tree:  # else the user has set another one since, and keeps it
            scene.compositing_node_group = kept.own_tree
    elif scene.node_tree:
        _end_nodes(scene, json.loads(kept.host or "{}"))
    tree, kept.tree, kept.own_tree = kept.tree, None, None
    if tree is not None and tree.users == 0:
        bpy.data.node_groups.remove(tree)


def _end_effects(scene: bpy.types.Scene, kept: GssmcComposite) -> None:
    effects = scene.compositor_effects
    for effect in [one for one in effects if one.node_group is not None and one.node_group == kept.tree]:
        effects.remove(effect)
    for name, enabled, active in json.loads(kept.host or "[]"):
        if name in effects:
            effects[name].enable_for_render = enabled
            if active:
                effects[name].is_active = True


def _end_nodes(scene: bpy.types.Scene, before: dict[str, str | bool]) -> None:
    nodes = scene.node_tree.nodes
    for node in [one for one in nodes if MADE in one]:
        nodes.remove(node)
    for name in (before.get("output", ""), before.get("active", "")):
        if name in nodes:
            nodes.active = nodes[name]
    if not before.get("active"):
        nodes.active = None
    scene.use_nodes = bool(before.get("use_nodes"))


def _new_group() -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(NAME, "CompositorNodeTree")
    tree.interface.new_socket(name="Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return tree


def _output_of(scene: bpy.types.Scene) -> str:
    """The name of the Composite node that Blender takes now; it does not tell, but of one there is no doubt."""
    found = [node.name for node in scene.node_tree.nodes if node.type == "COMPOSITE"]
    active = scene.node_tree.nodes.active
    return active.name if active and active.name in found else next(iter(found), "")
