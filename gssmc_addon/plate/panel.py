"""Moving plates in the sidebar."""

from __future__ import annotations

import bpy

from ..photo import image as photo_image
from ..refine import panel as panels
from ..support.texts import iface_
from .source import MOVING


class GSSMC_PT_plate(panels._Sidebar, bpy.types.Panel):
    bl_label = "Moving Plate"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, camera = self.layout, context.scene.camera
        camera = camera if camera and camera.type == "CAMERA" else None
        layout.operator("gssmc.add_plate", icon="FILE_MOVIE")
        if not camera or not _moves(camera):
            hint = iface_("Add a movie or an image sequence, go to a frame and bring the camera there.")
            panels.draw_text(layout, context, hint)
            return
        column = layout.column(align=True)
        column.operator("gssmc.track_plate", text="Track Every Frame...", icon="TRACKER")
        column.operator("gssmc.refine_sequence", text="Refine Every Nth Frame...", icon="CAMERA_DATA")
        if camera.data.gssmc.bad_frames:
            text = iface_("Weak or bad frames: {frames}", frames=camera.data.gssmc.bad_frames)
            box = layout.box()
            panels.draw_text(box, context, text, icon="ERROR")
            row = box.row(align=True)
            row.operator("gssmc.weak_frame", text="Previous", icon="TRIA_LEFT").step = -1
            row.operator("gssmc.weak_frame", text="Next", icon="TRIA_RIGHT").step = 1


def _moves(camera: bpy.types.Object) -> bool:
    """Whether the camera has a plate; cheap, for it is asked at every redraw."""
    image = photo_image.camera_photo(camera)
    if image:
        return image.source in MOVING
    return any(slot.source == "MOVIE_CLIP" and slot.clip for slot in camera.data.background_images)


classes = (GSSMC_PT_plate,)
