"""Set Mask: a picture that says what of a photo is left out of matching."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from ..core.errors import CameraError, GssmcError
from ..gssmc_addon.photo import image as photo_image
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
            image = mask_source.load(self.filepath)
            both = mask_source.MaskedSource(plate_source.source_at(scene, camera, photo), mask_source.source(image))
            said = both.read().notes[-1]
        except GssmcError:
            for new in set(bpy.data.images) - before:
                bpy.data.images.remove(new)
            raise
        camera.data.gssmc.mask = image
        return self.done(context, said)


classes = (GSSMC_OT_set_mask,)
