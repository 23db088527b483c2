"""Moving plates in the sidebar."""

from __future__ import annotations

import bpy

from ..refine import panel as panels
from ..support.texts import iface_
from .source import moves
from .track import pins
from .track import plot as frame_plot

PLOT_SCALE = 8.0


class GSSMC_PT_plate(panels._Sidebar, bpy.types.Panel):
    bl_label = "Moving Plate"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, camera = self.layout, context.scene.camera
        camera = camera if camera and camera.type == "CAMERA" else None
        layout.operator("gssmc.add_plate", icon="FILE_MOVIE")
        if not camera or not moves(camera):
            hint = iface_("Add a movie or an image sequence, go to a frame and bring the camera there.")
            panels.draw_text(layout, context, hint)
            return
        column = layout.column(align=True)
        column.operator("gssmc.track_plate", text="Track Every Frame...", icon="TRACKER")
        column.operator("gssmc.refine_sequence", text="Refine Every Nth Frame...", icon="CAMERA_DATA")
        pinned = context.scene.frame_current in pins.frames(camera.data)
        text = iface_("Unpin This Frame") if pinned else iface_("Pin This Frame")
        column.operator("gssmc.pin_frame", text=text, icon="PINNED" if pinned else "UNPINNED", translate=False)
        _draw_errors(layout, camera)
        if camera.data.gssmc.bad_frames:
            text = iface_("Weak or bad frames: {frames}", frames=camera.data.gssmc.bad_frames)
            box = layout.box()
            panels.draw_text(box, context, text, icon="ERROR")
            row = box.row(align=True)
            row.operator("gssmc.weak_frame", text="Previous", icon="TRIA_LEFT").step = -1
            row.operator("gssmc.weak_frame", text="Next", icon="TRIA_RIGHT").step = 1


def _draw_errors(layout: bpy.types.UILayout, camera: bpy.types.Object) -> None:
    """The error of this frame, and the curve of all."""
    picture = frame_plot.icon(camera.data)
    if picture:
        box = layout.box().column()
        row = box.row()
        row.enabled = False  # It is measured, not set.
        row.prop(camera.data.gssmc, "frame_error_px", text="Error Here (px)")
        box.template_icon(icon_value=picture, scale=PLOT_SCALE)


classes = (GSSMC_PT_plate,)
