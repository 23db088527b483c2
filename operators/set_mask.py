"""Set Mask, Masks From Folder: what is left out of matching, for one photo or for all on the list."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ..core.errors import CameraError, GssmcError
from ..core.photos.mask import find_mask
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo import mask as mask_source
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.support.operator_parts import FromFile, PlainOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_set_mask(PlainOperator, bpy.types.Operator, FromFile):
    """Choose a picture that leaves people, sky and cars out of matching: white is used, black is not"""

    bl_idname = "gssmc.set_mask"
    bl_label = "Set Mask"
    bl_options = {"UNDO"}

    __annotations__ = {
        "filter_image": BoolProperty(default=True, options={"HIDDEN"}),
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
        "camera": StringProperty(
            name="Camera", description="Name of the camera object; empty: the scene camera", options={"HIDDEN", "SKIP_SAVE"}
        ),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        camera = bpy.data.objects.get(self.camera) if self.camera else scene.camera
        before = set(bpy.data.images)
        try:
            photo = photo_image.camera_photo(camera) if camera and camera.type == "CAMERA" else None
            if camera is None or photo is None:
                raise CameraError(rpt_("There is no photo to mask; use Add Photo in the GS-SMC panel first."))
            image = _load(self.filepath)
            both = mask_source.MaskedSource(plate_source.source_at(scene, camera, photo), mask_source.source(image))
            said = both.read().notes[-1]
        except GssmcError:
            for new in set(bpy.data.images) - before:
                bpy.data.images.remove(new)
            raise
        camera.data.gssmc.mask = image
        return self.done(context, said)


class GSSMC_OT_set_masks(PlainOperator, bpy.types.Operator, FromFile):
    """Give the photos of the list their masks from a folder: of photo.jpg it is photo.jpg.png, photo.jpg or photo.png"""

    bl_idname = "gssmc.set_masks"
    bl_label = "Masks From Folder"
    bl_options = {"UNDO"}

    __annotations__ = {
        "directory": StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"}),
        "filter_image": BoolProperty(default=True, options={"HIDDEN"}),  # else a full folder looks empty
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not photo_list.cameras(context.scene):
            cls.poll_message_set("There are no photos on the list; use Add Photos first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> set[str]:
        """Sizes are checked when a photo is refined: reading all of them takes minutes."""
        scene, folder = context.scene, Path(bpy.path.abspath(self.directory))
        cameras = photo_list.cameras(scene)
        images = [(camera, photo_image.camera_photo(camera)) for camera in cameras]
        found = [(c, find_mask(folder, Path(photo_image.photo_file(i) or i.name))) for c, i in images if i]
        masks = [(camera, _load(str(file))) for camera, file in found if file]
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


def _load(path: str) -> bpy.types.Image:
    """The mask as a Blender image. Raises CameraError when there is no such file."""
    try:
        return bpy.data.images.load(bpy.path.abspath(path), check_existing=True)
    except RuntimeError:
        raise CameraError(rpt_("There is no mask at '{path}'; check the path.", path=path)) from None


classes = (GSSMC_OT_set_mask, GSSMC_OT_set_masks)
