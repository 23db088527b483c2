"""Undistort Photo: a copy for the background that agrees with Blender's cameras, which have no lens distortion."""

import bpy

from ..core.errors import CameraError, GssmcError
from ..core.undistort import undistorted
from ..gssmc_addon import camera_bridge, photo_image


class GSSMC_OT_undistort_photo(bpy.types.Operator):
    """Show a copy of the photo without its lens distortion behind the camera; the photo itself stays what Refine works on"""

    bl_idname = "gssmc.undistort_photo"
    bl_label = "Undistort Background"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        camera = context.scene.camera
        if camera is None or camera.type != "CAMERA" or photo_image.camera_photo(camera) is None:
            cls.poll_message_set("The scene camera has no photo")
            return False
        return True

    def execute(self, context):
        camera = context.scene.camera
        try:
            copy = self._copy(context.scene, camera)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f'"{copy.name}" is set behind "{camera.name}".')
        return {"FINISHED"}

    def _copy(self, scene, camera):
        data, image = camera.data, photo_image.camera_photo(camera)
        photo = photo_image.photo_source(image).read()
        lens = camera_bridge.photo_intrinsics(scene, data, photo.width, photo.height)
        if not lens.has_distortion:
            raise CameraError(f'The camera "{camera.name}" has no lens distortion; set k1 in the Lens panel, or solve for it.')
        if data.gssmc.photo != image:
            data.gssmc.photo = image
        return photo_image.show_instead(data, image, undistorted(photo, lens))


classes = (GSSMC_OT_undistort_photo,)
