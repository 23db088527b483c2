"""File > Import and Export, and files dropped on the viewport."""

from __future__ import annotations

import bpy

from ...core.splats import SUFFIXES
from ...core.support.picture_names import PICTURES


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


class GSSMC_FH_photos(bpy.types.FileHandler):
    bl_idname = "GSSMC_FH_photos"
    bl_label = "Photos to Place in the Splat"
    bl_import_operator = "gssmc.add_photos"
    bl_file_extensions = ";".join(PICTURES)

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        """In a scene without a splat pictures stay Blender's own."""
        return context.area is not None and context.area.type == "VIEW_3D" and context.scene.gssmc.splat is not None


classes = (GSSMC_FH_splats, GSSMC_FH_photos)


class _Keys:
    """The extension's keys, to be taken back."""

    def __init__(self) -> None:
        self.items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


_keys = _Keys()


def _register_keys() -> None:
    """V and the double click in Object Mode, which Blender leaves free there. Without a window there are no keys."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration:
        keys = configuration.keymaps.new(name="Object Mode", space_type="EMPTY")
        _keys.items.append((keys, keys.keymap_items.new("gssmc.look", "V", "PRESS")))
        _keys.items.append((keys, keys.keymap_items.new("gssmc.look_through_card", "LEFTMOUSE", "DOUBLE_CLICK")))


def register() -> None:
    _register_keys()
    bpy.types.TOPBAR_MT_file_import.append(_draw_import)
    bpy.types.TOPBAR_MT_file_export.append(_draw_export)


def unregister() -> None:
    while _keys.items:
        keys, item = _keys.items.pop()
        keys.keymap_items.remove(item)
    bpy.types.TOPBAR_MT_file_export.remove(_draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(_draw_import)
