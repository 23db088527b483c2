"""Remove Photo: a line of the list, and the camera that was made for it."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from ..gssmc_addon.jobs.operator import Idle, Reporter
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_remove_photo(Idle, Reporter, bpy.types.Operator):
    """Take the photo out of the list, and its camera out of the scene"""

    bl_idname = "gssmc.remove_photo"
    bl_label = "Remove Photo"
    bl_options = {"UNDO"}

    __annotations__ = {
        "camera": BoolProperty(name="Camera Too", default=True, description="Also delete the photo's camera"),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        own = context.scene.gssmc
        if not 0 <= own.photo_index < len(own.photos):
            cls.poll_message_set("No photo of the list is picked; click one first")
            return False
        return super().poll(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        own = context.scene.gssmc
        index, entry = own.photo_index, own.photos[own.photo_index]
        title, camera = photo_list.title(entry), photo_list.camera_of(context.scene, entry)
        own.photos.remove(index)
        if camera and self.camera:
            _delete(camera)
        own.photo_index = max(0, min(index, len(own.photos) - 1))
        return self.done(context, rpt_('"{photo}" was removed.', photo=title))


def _delete(camera: bpy.types.Object) -> None:
    """The camera, its data, its photo and mask, where nothing else uses them."""
    data, images = camera.data, {photo_image.camera_photo(camera), camera.data.gssmc.mask} - {None}
    bpy.data.objects.remove(camera)
    if data.users == 0:
        bpy.data.cameras.remove(data)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)


classes = (GSSMC_OT_remove_photo,)
