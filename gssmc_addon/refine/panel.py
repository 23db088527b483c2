"""The sidebar panel "GS-SMC": splat, photo, refine, and what came of it."""

from __future__ import annotations

import bpy

from ..camera import solution as camera_solution
from ..jobs import slot
from ..jobs.machine import CATEGORY
from ..photo import image as photo_image
from ..plate import source as plate_source
from ..registration import camera_props, preferences
from ..registration import settings as settings_props
from ..splat import object as splat_object
from ..support import wrapping
from ..support.texts import iface_
from ..viewport import props as viewport_props

LINE_SCALE = 0.8  # of a line of text
OUTCOME_LINES = 4  # Enough for the first and most important sentence of a verdict in a sidebar of the usual width.


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY


class GSSMC_PT_main(_Sidebar, bpy.types.Panel):
    """The four steps from a scan and a photo to its camera. All are there from the start: nothing moves under the mouse."""

    bl_label = "Photo Camera"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        camera = scene.camera if scene.camera and scene.camera.type == "CAMERA" else None
        photo = photo_image.camera_photo(camera) if camera else None
        _draw_splat(layout, context)
        _draw_photo(layout, context, camera)
        _draw_camera(layout, context, camera if photo else None)
        _draw_refine(layout, context, camera if photo else None)


def _step(layout: bpy.types.UILayout, text: str, done: bool) -> bpy.types.UILayout:
    """A column with the heading of a step."""
    column = layout.column(align=True)
    column.label(text=text, icon="CHECKMARK" if done else "RADIOBUT_OFF")
    return column


def _draw_splat(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    column = _step(layout, "1  Splat", context.scene.gssmc.splat is not None)
    if any(splat_object.is_splat(o) for o in context.scene.objects):
        column.prop(context.scene.gssmc, "splat", text="")
        viewport_props.draw_settings(column, context.scene.gssmc.splat)
    else:
        column.operator("gssmc.import_splats", text="Import Splat", icon="IMPORT")


def _draw_photo(layout: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    photo = photo_image.camera_photo(camera) if camera else None
    column = _step(layout, "2  Photo", photo is not None)
    if camera:
        column.prop(camera.data.gssmc, "photo", text="")
        if photo:
            row = column.row(align=True)
            row.prop(camera.data.gssmc, "mask", text="", icon="MOD_MASK", placeholder="Mask")
            row.operator("gssmc.set_mask", text="", icon="FILEBROWSER")
    column.operator("gssmc.add_photo", icon="IMAGE_DATA")


def _draw_camera(layout: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    column = _step(layout, "3  Camera", camera is not None and camera.data.gssmc.verdict != "NONE")
    if camera:
        column.prop(context.scene, "camera", text="")
        column.prop(camera.data, "lens")
        column.prop(context.space_data, "lock_camera", text="Move Camera With View", toggle=True)
        column.operator("gssmc.camera_from_view")


def _draw_refine(layout: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    """The buttons, or the progress in their place, and the box below, as high before and while a camera is refined as after."""
    job = slot.active()
    column = _step(
        layout, "4  Find or Refine", camera is not None and camera_solution.verdict(context.scene, camera) == "TRUSTED"
    )
    row = column.row(align=True)
    row.scale_y = 1.5
    if job:
        row.progress(factor=job.fraction, text=job.step)
        row.operator("gssmc.cancel", text="", icon="X")
    else:
        row.operator("gssmc.find_camera", icon="VIEWZOOM")
        row.operator("gssmc.refine", icon="CAMERA_DATA")
    _draw_outcome(layout.box(), context, camera)


def _draw_outcome(box: bpy.types.UILayout, context: bpy.types.Context, camera: bpy.types.Object | None) -> None:
    """What came of it: a title and OUTCOME_LINES lines of text, all of it when unfolded. Where the camera is no
    longer what was solved, the title says so, and the way back takes the place of a line.
    """
    last, props = context.window_manager.gssmc, camera.data.gssmc if camera else None
    titles, icon, texts = _outcome(context.scene, props, last.message)
    changed = camera_solution.title(context.scene, camera) if camera and not slot.active() else ""
    room = wrapping.room_px(context, icon=True) - wrapping.ICON_PX  # of the arrow
    if changed:
        below = 1 if last.message else 0  # The message stays in the first line, with its icon.
        texts = [*texts[:below], titles[0], *texts[below:]]
        titles, icon = [changed], camera_props.VERDICT_ICONS[camera_solution.CHANGED]
    row = box.row()
    row.label(text=next((text for text in titles if wrapping.fits(text, room)), titles[-1]), icon=icon)
    row.prop(last, "details", text="", icon="DISCLOSURE_TRI_DOWN" if last.details else "DISCLOSURE_TRI_RIGHT", emboss=False)
    column = _column_of_lines(box)
    if changed:
        column.operator("gssmc.back_to_solution", icon="LOOP_BACK")
    icon = last.message_icon if last.message and not slot.active() else "NONE"
    if last.details:
        for text in texts or [""]:
            draw_text(box, context, text, icon=icon)
            icon = "NONE"
    else:
        count = OUTCOME_LINES - 1 if changed else OUTCOME_LINES
        _draw_lines(column, wrapping.fitted(texts, wrapping.room_px(context, icon != "NONE"), count), icon)


def _outcome(scene: bpy.types.Scene, props: camera_props.GssmcCamera | None, message: str) -> tuple[list[str], str, list[str]]:
    """Title (the longest first), icon and texts: of a job its progress, else the last message and the camera's verdict, or
    what to do next where neither is there.
    """
    job = slot.active()
    if job:
        return [iface_("Working")], "TIME", [job.detail]
    if props is None or props.verdict == "NONE":
        hint = iface_("Find Camera looks for it in the scan; Refine Camera starts from where the camera stands.")
        if props is None and splat_object.is_splat(scene.gssmc.splat):
            hint = iface_("Add a photo that was taken in the scanned place.")
        elif props is None:
            hint = iface_("Import a splat and add a photo that was taken there.")
        return [iface_("Not solved yet") if props else iface_("No photo yet")], "BLANK1", [message or hint]
    titles = [camera_props.verdict_title(props), iface_(camera_props.VERDICT_NAMES[props.verdict])]
    reasons = props.reasons.splitlines()
    return titles, camera_props.VERDICT_ICONS[props.verdict], [message, *reasons] if message else reasons


def draw_text(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE", least: int = 0) -> None:
    """A sentence in the user's language, wrapped to the sidebar's width; empty lines make it at least `least` lines high."""
    found = wrapping.lines(text, wrapping.room_px(context, icon != "NONE"))
    _draw_lines(_column_of_lines(layout), found + [""] * (least - len(found)), icon)


def _column_of_lines(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    column = layout.column(align=True)
    column.scale_y = LINE_SCALE
    return column


def _draw_lines(column: bpy.types.UILayout, lines: list[str], icon: str) -> None:
    for number, line in enumerate(lines):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"), translate=False)


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
        moves = plate_source.moves(context.scene.camera)
        column.operator("gssmc.undistort_plate" if moves else "gssmc.undistort_photo", text="Undistort Background")
        column.operator("gssmc.match_resolution")


class GSSMC_PT_quality(_Sidebar, bpy.types.Panel):
    bl_label = "Quality"
    bl_parent_id = "GSSMC_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        own = context.scene.gssmc
        row = self.layout.row(align=True)
        for word in ("DRAFT", "NORMAL", "BEST"):
            row.prop_enum(own, "quality", word)


class GSSMC_PT_settings(_Sidebar, bpy.types.Panel):
    bl_label = "Values"
    bl_parent_id = "GSSMC_PT_quality"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        column = self.layout.column()
        for name in settings_props.settings_annotations():
            if name == settings_props.LENS:
                continue
            column.prop(context.scene.gssmc, name)
            if name in settings_props.CHOICES:
                _draw_missing_model(column, context, getattr(context.scene.gssmc, name))
        column.prop(context.scene.gssmc, settings_props.MAP_VIEWS)
        self.layout.operator("gssmc.reset_settings", icon="LOOP_BACK")


def _draw_missing_model(layout: bpy.types.UILayout, context: bpy.types.Context, choice: str) -> None:
    """Says that a choice lacks its model file, with the way to the preferences."""
    kind = preferences.LEARNED.get(choice)
    if kind and not preferences.model_for(context, choice):
        layout.label(text=iface_("{name} needs a model file", name=kind.title), icon="ERROR")
        layout.operator("preferences.addon_show", text="Open Preferences").module = preferences.PACKAGE


classes = (GSSMC_PT_main, GSSMC_PT_quality, GSSMC_PT_settings, GSSMC_PT_lens)
