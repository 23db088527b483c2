"""The sidebar panel "GS-SMC": splat, photo, refine, and what came of it."""

from __future__ import annotations

import textwrap

import bpy

from ..camera import solution as camera_solution
from ..jobs import slot as jobs
from ..jobs.machine import CATEGORY, Job
from ..photo import image as photo_image
from ..registration import camera_props, preferences
from ..registration import settings as settings_props
from ..splat import object as splat_object
from ..support.texts import iface_
from ..viewport import props as viewport_props

PIXELS_PER_CHARACTER = 6.4


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY


class GSSMC_PT_main(_Sidebar, bpy.types.Panel):
    bl_label = "Photo Camera"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        _draw_splat(layout, context)
        camera = context.scene.camera
        camera = camera if camera and camera.type == "CAMERA" else None
        _draw_photo(layout, context, camera)
        job = jobs.active()
        if job:
            _draw_progress(layout, job)
        else:
            _draw_refine(layout, context, camera)


def _draw_splat(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    column = layout.column(align=True)
    column.label(text="Splat")
    if any(splat_object.is_splat(o) for o in context.scene.objects):
        column.prop(context.scene.gssmc, "splat", text="")
        viewport_props.draw_settings(column, context.scene.gssmc.splat)
    else:
        column.operator("gssmc.import_splats", text="Import Splat", icon="IMPORT")


def _draw_photo(layout: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    column = layout.column(align=True)
    column.label(text="Photo")
    if camera:
        column.prop(camera.data.gssmc, "photo", text="")
        if photo_image.camera_photo(camera):
            row = column.row(align=True)
            row.prop(camera.data.gssmc, "mask", text="", icon="MOD_MASK", placeholder="Mask")
            row.operator("gssmc.set_mask", text="", icon="FILEBROWSER")
    column.operator("gssmc.add_photo", icon="IMAGE_DATA")
    if camera and photo_image.camera_photo(camera):
        column.separator()
        column.label(text="Camera")
        column.prop(context.scene, "camera", text="")
        column.prop(camera.data, "lens")
        view = context.space_data
        column.prop(view, "lock_camera", text="Move Camera With View", toggle=True)
        column.operator("gssmc.camera_from_view")
        if camera.data.gssmc.verdict == "NONE" and not jobs.active():
            draw_text(layout, context, iface_("Bring the camera to about where the photo was taken, then refine."))


def _draw_progress(layout: bpy.types.UILayout, job: Job) -> None:
    column = layout.column(align=True)
    column.progress(factor=job.fraction, text=job.step)
    if job.detail:
        column.label(text=job.detail)
    column.operator("gssmc.cancel", icon="X")


def _draw_refine(layout: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    column = layout.column(align=True)
    row = column.row()
    row.scale_y = 1.5
    row.operator("gssmc.refine", icon="CAMERA_DATA")
    note = camera.data.gssmc if camera else None
    if note and note.verdict != "NONE":
        _draw_verdict(layout.box(), context, camera)
    last = context.window_manager.gssmc
    if last.message:
        draw_text(layout.box(), context, last.message, icon=last.message_icon)


def _draw_verdict(box: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object) -> None:
    """What came of the last refinement; greyed out, with the way back, where the camera is no longer what was solved."""
    note, changed = camera.data.gssmc, camera_solution.title(context.scene, camera)
    if changed:
        box.label(text=changed, icon=camera_props.VERDICT_ICONS[camera_solution.CHANGED])
        box.operator("gssmc.back_to_solution", icon="LOOP_BACK")
    column = box.column(align=True)
    column.active = not changed or note.verdict == "FAILED"
    column.label(text=camera_props.verdict_title(note), icon=camera_props.VERDICT_ICONS[note.verdict])
    for reason in note.reasons.splitlines():
        draw_text(column, context, reason)


def draw_text(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """A sentence in the user's language, wrapped to the sidebar's width."""
    scale = context.preferences.system.ui_scale
    width = max(16, int((context.region.width / scale - 60) / PIXELS_PER_CHARACTER))
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))


class GSSMC_PT_lens(_Sidebar, bpy.types.Panel):
    bl_label = "Lens"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene.camera is not None and context.scene.camera.type == "CAMERA"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        data = context.scene.camera.data
        column = self.layout.column(align=True)
        column.prop(data.gssmc, "lens_state")
        column.prop(context.scene.gssmc, "lens", text="Solve For")
        column = self.layout.column(align=True)
        column.prop(data, "shift_x", text="Shift X")
        column.prop(data, "shift_y", text="Y")
        column = self.layout.column(align=True)
        for name in ("k1", "k2", "p1", "p2", "k3"):
            column.prop(data.gssmc, name, text="Distortion k1" if name == "k1" else name)
        column = self.layout.column(align=True)
        column.operator("gssmc.undistort_photo")
        column.operator("gssmc.match_resolution")


class GSSMC_PT_settings(_Sidebar, bpy.types.Panel):
    bl_label = "Settings"
    bl_parent_id = "GSSMC_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        column = self.layout.column()
        for name in settings_props.settings_annotations():
            if name == "lens":  # stands in the Lens panel
                continue
            column.prop(context.scene.gssmc, name)
            if name in settings_props.CHOICES:
                _draw_missing_model(column, context, getattr(context.scene.gssmc, name))


def _draw_missing_model(layout: bpy.types.UILayout, context: bpy.types.Context, choice: str) -> None:
    """Says that a choice lacks its model file, with the way to the preferences."""
    kind = preferences.LEARNED.get(choice)
    if kind and not preferences.model_for(context, choice):
        layout.label(text=iface_("{name} needs a model file", name=kind.title), icon="ERROR")
        layout.operator("preferences.addon_show", text="Open Preferences").module = preferences.PACKAGE


classes = (GSSMC_PT_main, GSSMC_PT_lens, GSSMC_PT_settings)
