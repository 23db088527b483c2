"""Match Photo Resolution: the render becomes the photo's size, and the lens follows."""

import bpy

from ..core.errors import PhotoError
from ..gssmc_addon.camera import bridge as camera_bridge
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.support.operator_parts import OfPhoto
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_match_resolution(OfPhoto, bpy.types.Operator):
    """Make the render resolution the photo's, so that it fills the camera's frame; the camera keeps its fit"""

    bl_idname = "gssmc.match_resolution"
    bl_label = "Match Photo Resolution"
    bl_options = {"UNDO"}

    def run(self, context):
        scene, camera = context.scene, context.scene.camera
        width, height = photo_image.camera_photo(camera).size
        if not width or not height:
            raise PhotoError(rpt_("The photo's file cannot be read; add the photo again."))
        lens = camera_bridge.photo_intrinsics(scene, camera.data, width, height)
        notes = photo_camera.frame(scene, width, height, allowed=True)
        camera_bridge.write_intrinsics(scene, camera.data, lens)
        return self.done(context, " ".join(notes) or rpt_("The render has the photo's shape already."))


classes = (GSSMC_OT_match_resolution,)
