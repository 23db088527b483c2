"""File > Import and Export, and files dropped on the viewport."""

from __future__ import annotations

import bpy

from ...core.splats import SUFFIXES


def _draw_import(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.operator("gssmc.import_splats", text="Gaussian Splats (.ply, .spz, .splat)")
    self.layout.operator("gssmc.import_cameras", text="Photo Cameras (COLMAP, transforms.json, JSON)")


def _draw_export(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.operator("gssmc.export_splats", text="Gaussian Splats (.ply)")
    self.layout.operator("gssmc.export_cameras", text="Photo Cameras (COLMAP, transforms.json, JSON)")


class GSSMC_FH_splats(bpy.types.FileHandler):
    bl_idname = "GSSMC_FH_splats"
    bl_label = "Gaussian Splats"
    bl_import_operator = "gssmc.import_splats"
    # Files of USD that are dropped stay Blender's own, and a file handler knows no whole names.
    bl_file_extensions = ";".join(suffix for suffix in SUFFIXES if suffix.startswith(".") and not suffix.startswith(".usd"))

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


classes = (GSSMC_FH_splats,)


def register() -> None:
    bpy.types.TOPBAR_MT_file_import.append(_draw_import)
    bpy.types.TOPBAR_MT_file_export.append(_draw_export)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(_draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(_draw_import)
