"""Add Folder: all photographs of a folder, each with a camera of its own."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..gssmc_addon.photo import adding
from .add_photos import AddsPhotos


class GSSMC_OT_add_photo_folder(AddsPhotos, bpy.types.Operator):
    """Load all photographs of the folder that the file browser shows, whichever is picked; each gets a camera of its own"""

    bl_idname = "gssmc.add_photo_folder"
    bl_label = "Add Folder"
    bl_options = {"UNDO"}

    __annotations__ = {**AddsPhotos.__annotations__}

    def _chosen(self) -> list[Path]:
        return adding.photos_in(self._folder())

    def _others(self) -> list[str]:
        return adding.others_in(self._folder())

    def _raws(self) -> int:
        return len(adding.raws_in(self._folder()))

    def _folder(self) -> Path:
        """The folder that the browser shows; scripts may name the folder or a photo in it."""
        if not self.directory and self.filepath:
            path = Path(bpy.path.abspath(self.filepath))
            return path if path.is_dir() else path.parent
        return Path(bpy.path.abspath(self.directory))


classes = (GSSMC_OT_add_photo_folder,)
