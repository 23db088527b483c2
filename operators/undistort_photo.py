"""Undistort Photo: a copy for the background that agrees with Blender's cameras, which have no lens distortion."""

from __future__ import annotations

import bpy

from ..core.errors import CameraError
from ..core.photos.undistort import undistorted
from ..gssmc_addon.camera import bridge as camera_bridge
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.support.operator_parts import OfPhoto
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_undistort_photo(OfPhoto, bpy.types.Operator):
    """Show a copy of the photo without its lens distortion behind the camera; the photo itself stays what Refine works on"""

    bl_idname = "gssmc.undistort_photo"
    bl_label = "Undistort Background"
    bl_options = {"UNDO"}

    def run(self, context: bpy.types.Context) -> set[str]:
        camera = context.scene.camera
        copy = self._copy(context.scene, camera)
        return self.done(context, rpt_('"{photo}" is set behind "{camera}".', photo=copy.name, camera=camera.name))

    def _copy(self, scene: bpy.types.Scene, camera: bpy.types.Object) -> bpy.types.Image:
        data, image = camera.data, photo_image.camera_photo(camera)
        if image is None:
            raise CameraError(rpt_('The camera "{name}" has no photo; use Add Photo in the GS-SMC panel.', name=camera.name))
        if image.source in plate_source.MOVING:
            raise CameraError(rpt_('"{photo}" moves; use Undistort Plate, which writes all of its frames.', photo=image.name))
        photo = photo_image.photo_source(image).read()
        lens = camera_bridge.photo_intrinsics(scene, data, photo.width, photo.height)
        if not lens.has_distortion:
            raise CameraError(
                rpt_('The camera "{name}" has no lens distortion; set k1 in the Lens panel, or solve for it.', name=camera.name)
            )
        if data.gssmc.photo != image:
            data.gssmc.photo = image
        return photo_image.show_instead(data, image, undistorted(photo, lens))


classes = (GSSMC_OT_undistort_photo,)
