"""Proxies in the sidebar."""

from __future__ import annotations

import bpy

from ..refine import panel as panels
from ..support.texts import iface_
from . import objects as proxy_objects
from .uses import USES

ICONS = {"SHADOW_CATCHER": "SHADING_RENDERED", "HOLDOUT": "HOLDOUT_ON", "COLLISION": "MOD_PHYSICS", "SNAP": "SNAP_FACE"}
NAMES = {word: name for word, name, _ in USES}


class GSSMC_PT_proxy(panels._Sidebar, bpy.types.Panel):
    bl_label = "Proxy"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, splat = self.layout, context.scene.gssmc.splat
        layout.operator("gssmc.make_proxy", text="Make Proxy...", icon="MESH_GRID")
        found = proxy_objects.proxies_of(splat) if splat else []
        if not found:
            hint = iface_("A mesh of what cameras see of the splat: CG is hidden behind it, and casts shadows on it.")
            panels.draw_text(layout, context, hint)
        for obj in found:
            row = layout.row(align=True)
            row.prop(obj, "name", text="", icon=ICONS[obj.gssmc.proxy_use])
            row.label(text=NAMES[obj.gssmc.proxy_use])
            row.prop(obj, "hide_viewport", text="", emboss=False)


classes = (GSSMC_PT_proxy,)
