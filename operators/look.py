"""Align or Comp: the other look of the viewport, on one key."""

from __future__ import annotations

import bpy

from ..gssmc_addon.look import looks
from ..gssmc_addon.support.operator_parts import OfPhoto


class GSSMC_OT_look(OfPhoto, bpy.types.Operator):
    """Change between Align (photo before the splat) and Comp (photo behind, CG solid, hidden where the splat lies before it)"""

    bl_idname = "gssmc.look"
    bl_label = "Align or Comp"
    bl_options = {"UNDO"}

    def run(self, context: bpy.types.Context) -> set[str]:
        own = context.scene.gssmc
        own.look = looks.ALIGN if own.look == looks.COMP else looks.COMP
        return {"FINISHED"}


classes = (GSSMC_OT_look,)
