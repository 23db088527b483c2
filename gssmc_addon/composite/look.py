"""How the artist shows the CG (view transform, look, exposure, gamma), as compositor nodes.

From 5.0 on, Convert to Display has transform and look. Before, Convert Colorspace has the transforms alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from ..support.texts import rpt_
from .nodes import Nodes

STANDARD, NO_LOOK, SCREEN = "Standard", "None", "sRGB"
LINEAR_BEFORE_5 = "Linear Rec.709"
GAMMA, GAMMA_SINCE_5 = "CompositorNodeGamma", "ShaderNodeGamma"
# The colour spaces that are the view transforms of Blender 4.5.
SPACES = {STANDARD: SCREEN, "AgX": "AgX Base sRGB", "Filmic": "Filmic sRGB", "Khronos PBR Neutral": "Khronos PBR Neutral sRGB"}
BALANCE = ("white_balance_temperature", "white_balance_tint")


@dataclass(frozen=True)
class Look:
    """The scene's colour management: as it was before a composite was set up."""

    transform: str
    look: str
    exposure: float
    gamma: float
    curves: bool
    balance: tuple[float, float] | None

    @property
    def is_plain(self) -> bool:
        """Whether it shows an exposed picture as Standard does."""
        return self == Look(STANDARD, NO_LOOK, self.exposure, 1.0, False, None)


def of_scene(scene: bpy.types.Scene) -> Look:
    """The look that the scene has now."""
    view = scene.view_settings
    temperature, tint = (float(getattr(view, name)) for name in BALANCE)
    balance = (temperature, tint) if view.use_white_balance else None
    return Look(view.view_transform, view.look, view.exposure, view.gamma, view.use_curve_mapping, balance)


def make_plain(scene: bpy.types.Scene) -> list[str]:
    """Makes the scene show pixels as their files have them. Returns a sentence where its colour management has no Standard."""
    view = scene.view_settings
    try:
        view.view_transform = STANDARD
    except TypeError:  # a colour management of the user's own
        return [
            rpt_(
                'The view transform "{name}" stays and changes the plate too, for there is no Standard.',
                name=view.view_transform,
            )
        ]
    view.look, view.exposure, view.gamma = NO_LOOK, 0.0, 1.0
    view.use_curve_mapping = view.use_white_balance = False
    return []


def show_as(nodes: Nodes, picture: bpy.types.NodeSocket, look: Look) -> tuple[bpy.types.NodeSocket, list[str]]:
    """The picture (premultiplied, exposed) as the look shows it, and sentences on what of the look is left out."""
    if look.is_plain:
        return picture, []
    left_out = [name for name, there in (("white balance", look.balance is not None), ("curves", look.curves)) if there]
    picture = _alpha(nodes, picture, "To Straight", "PREMUL_TO_STRAIGHT")
    by_display = hasattr(bpy.types, "CompositorNodeConvertToDisplay")
    picture, refused = _by_display(nodes, picture, look) if by_display else _by_space(nodes, picture, look)
    if look.gamma != 1:
        node = nodes.new(GAMMA_SINCE_5 if by_display else GAMMA, "Gamma of the CG")
        nodes.link(picture, node.inputs[0])
        node.inputs["Gamma"].default_value = 1 / look.gamma
        picture = node.outputs[0]
    node = nodes.then(picture, "CompositorNodeConvertColorSpace", "Back to Light")
    node.from_color_space, node.to_color_space = SCREEN, _scene_linear()
    notes = [_left_out(left_out + refused)] if left_out or refused else []
    return _alpha(nodes, node.outputs["Image"], "To Premultiplied", "STRAIGHT_TO_PREMUL"), notes


def expose(nodes: Nodes, picture: bpy.types.NodeSocket, look: Look) -> bpy.types.NodeSocket:
    """The picture with the look's exposure."""
    node = nodes.then(picture, "CompositorNodeExposure", "Exposure of the CG")
    node.inputs["Exposure"].default_value = look.exposure
    return node.outputs["Image"]


def _alpha(nodes: Nodes, picture: bpy.types.NodeSocket, word: str, mapping: str) -> bpy.types.NodeSocket:
    """Divides the picture by its opacity, or multiplies it; the word is Blender's from 5.0 on, the mapping that before."""
    node = nodes.then(picture, "CompositorNodePremulKey", "Alpha")
    if "Type" in node.inputs:
        node.inputs["Type"].default_value = word
    else:
        node.mapping = mapping
    return node.outputs["Image"]


def _by_display(nodes: Nodes, picture: bpy.types.NodeSocket, look: Look) -> tuple[bpy.types.NodeSocket, list[str]]:
    """The picture in the screen's values, and what of the look Blender did not take."""
    node = nodes.then(picture, "CompositorNodeConvertToDisplay", "View Transform of the CG")
    refused = _set(node.display_settings, {"display_device": SCREEN})
    return node.outputs["Image"], refused + _set(node.view_settings, {"view_transform": look.transform, "look": look.look})


def _by_space(nodes: Nodes, picture: bpy.types.NodeSocket, look: Look) -> tuple[bpy.types.NodeSocket, list[str]]:
    """As `_by_display`, where colour spaces have to do."""
    refused = [] if look.look == NO_LOOK else ["look"]
    refused += [] if look.transform in SPACES else ["view transform"]
    node = nodes.then(picture, "CompositorNodeConvertColorSpace", "View Transform of the CG")
    node.from_color_space, node.to_color_space = _scene_linear(), SPACES.get(look.transform, SCREEN)
    return node.outputs["Image"], refused


def _scene_linear() -> str:
    """The colour space that the compositor works in."""
    return bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else LINEAR_BEFORE_5


def _set(settings: Any, wanted: dict[str, str]) -> list[str]:
    """Sets properties. Returns the names, in words, of those that do not take their value."""
    refused = []
    for name, value in wanted.items():
        try:
            setattr(settings, name, value)
        except (TypeError, AttributeError):
            refused.append(name.replace("_", " "))
    return refused


def _left_out(names: list[str]) -> str:
    return rpt_("Of the scene's colour management, this is not applied to the CG: {names}.", names=", ".join(names))
