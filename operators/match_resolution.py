"""Match Photo Resolution: the render becomes the photo's size, and the lens follows."""

from __future__ import annotations

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

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, camera = context.scene, context.scene.camera
        size = photo_image.own_size(camera.data)
        if not all(size):
            raise PhotoError(rpt_("The photo's file cannot be read; add the photo again."))
        camera_bridge.move_to_render(scene, camera.data, *size)  # A camera that was set by hand gets a frame here, too.
        notes = photo_camera.frame(scene, size, allowed=True, pixel=camera.data.gssmc.photo_pixel)
        return self.done(context, " ".join(notes) or rpt_("The render has the photo's shape already."))


classes = (GSSMC_OT_match_resolution,)
