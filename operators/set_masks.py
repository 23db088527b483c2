"""Masks From Folder: the photos of the list get their masks, by their names."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ..core.photos.mask import find_mask
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo import mask as mask_source
from ..gssmc_addon.support.operator_parts import FromFile, PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_set_masks(PlainOperator, bpy.types.Operator, FromFile):
    """Give the photos of the list their masks from a folder: of photo.jpg it is photo.jpg.png, photo.jpg or photo.png"""

    bl_idname = "gssmc.set_masks"
    bl_label = "Masks From Folder"
    bl_options = {"UNDO"}

    __annotations__ = {
        "directory": StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"}),
        "filter_image": BoolProperty(default=True, options={"HIDDEN"}),  # Without this a folder of pictures would look empty.
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return photo_list.poll(cls, context.scene)

    def run(self, context: bpy.types.Context) -> set[str]:
        """Assigns the masks. Their sizes are checked when a photo is refined, because reading all of them takes minutes."""
        scene, folder = context.scene, Path(bpy.path.abspath(self.directory))
        cameras = photo_list.cameras(scene)
        images = [(camera, photo_image.camera_photo(camera)) for camera in cameras]
        files = [(c, find_mask(folder, Path(photo_image.photo_file(i) or i.name))) for c, i in images if i]
        masks = [(camera, mask_source.load(str(file))) for camera, file in files if file]
        for camera, mask in masks:
            camera.data.gssmc.mask = mask
        values = {"count": len(masks), "photos": len(cameras), "folder": folder.name}
        told = rpt_("{count} of {photos} photos have a mask in '{folder}'.", **values)
        if len(cameras) == 1:
            told = rpt_("{count} of 1 photo has a mask in '{folder}'.", count=len(masks), folder=folder.name)
        if masks:
            return self.done(context, told)
        self.report({"WARNING"}, told)
        return {"CANCELLED"}


classes = (GSSMC_OT_set_masks,)
