"""The list of photos in the sidebar."""

from __future__ import annotations

from typing import Any

import bpy

from ..camera import solution as camera_solution
from ..refine import panel as panels
from ..registration import camera_props
from ..support.texts import iface_
from . import list as photo_list
from .entry import GssmcPhoto

ROWS = 4
SAID_LINES = 3


class GSSMC_UL_photos(bpy.types.UIList):
    """Tick, thumbnail, name, and what came of it."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: GssmcPhoto,
        icon: int,
        active_data: Any,
        active_property: str,
        index: int,
    ) -> None:
        """Draws one line. Blender counts the parameters, so the unused ones have to stay."""
        row = layout.row(align=True)
        row.prop(item, "ticked", text="")
        picture = photo_list.thumbnail(item)
        camera = photo_list.camera_of(context.scene, item)
        if picture:
            row.label(text="", icon_value=picture)
        else:
            row.label(text="", icon="IMAGE_DATA" if camera else "FILE_BLANK")
        if camera:
            row.prop(camera, "name", text="", emboss=False)
        else:
            row.label(text=photo_list.title(item) or iface_("Camera deleted"), translate=False)
        if _error(context.scene, item):  # The full text shows below the list when the line is selected.
            row.label(text="", icon="ERROR")
        elif camera:
            if camera.data.gssmc.mask:
                row.label(text="", icon="MOD_MASK")
            verdict = camera_solution.verdict(context.scene, camera)
            row.label(text="", icon=camera_props.VERDICT_ICONS[verdict] if verdict != "NONE" else "BLANK1")

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.bpy_struct, propname: str
    ) -> tuple[list[int], list[int]]:
        """By name, as the list's search field asks; the names are the cameras'."""
        items = getattr(data, propname)
        wanted = self.filter_name.lower()
        flags = [self.bitflag_filter_item if wanted in photo_list.title(item).lower() else 0 for item in items]
        return flags if wanted else [], []


class GSSMC_PT_photos(panels._Sidebar, bpy.types.Panel):
    bl_label = "Photos"
    bl_parent_id = "GSSMC_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        layout, own = self.layout, context.scene.gssmc
        row = layout.row()
        row.template_list("GSSMC_UL_photos", "", own, "photos", own, "photo_index", rows=ROWS)
        column = row.column(align=True)
        column.operator("gssmc.add_photos", text="", icon="ADD")
        column.operator("gssmc.remove_photo", text="", icon="REMOVE")
        column.separator()
        column.operator("gssmc.add_photo_folder", text="", icon="FILE_FOLDER")
        column.operator("gssmc.set_masks", text="", icon="MOD_MASK")
        column.prop(own, "show_all_cameras", text="", icon="OUTLINER_OB_CAMERA")
        if own.photos:
            _draw_review(layout)
            _draw_refine(layout, context)
            _draw_lens(layout, context)
            _draw_said(layout, context)


def _draw_review(layout: bpy.types.UILayout) -> None:
    row = layout.row(align=True)
    row.operator("gssmc.review", text="Previous").step = -1
    row.operator("gssmc.review", text="Next").step = 1
    unsure = row.operator("gssmc.review", text="", icon="QUESTION")
    unsure.step, unsure.skip_trusted = 1, True


def _draw_refine(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What one wants most of the time comes first; while a job runs, the operator's poll greys the buttons."""
    left = photo_list.open_count(context.scene)
    column = layout.column(align=True)
    row = column.row(align=True)
    row.scale_y, row.enabled = 1.25, left > 0
    row.operator("gssmc.find_all", text=iface_("Find Open ({count})", count=left), icon="VIEWZOOM").which = "OPEN"
    row.operator("gssmc.refine_all", text=iface_("Refine Open ({count})", count=left), icon="CAMERA_DATA").which = "OPEN"
    for name, title in (("find_all", iface_("Find")), ("refine_all", iface_("Refine"))):
        row = column.row(align=True)
        row.label(text=title)
        row.operator(f"gssmc.{name}", text="Ticked").which = "TICKED"
        row.operator(f"gssmc.{name}", text="All").which = "ALL"


def _draw_lens(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Sharing the lens, and the group of the picked photo."""
    own = context.scene.gssmc
    row = layout.row(align=True)
    row.operator("gssmc.same_lens", icon="LINKED")
    if own.photo_index < len(own.photos):
        row.prop(own.photos[own.photo_index], "lens_group", text="", placeholder="Group by EXIF")


def _draw_said(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What is wrong with the picked photo, or how it was found. Below all buttons, and there when there is nothing to say, so
    that no button moves while one goes from photo to photo.
    """
    own = context.scene.gssmc
    entry = own.photos[own.photo_index] if own.photo_index < len(own.photos) else None
    error = _error(context.scene, entry) if entry else ""
    note = entry.note if entry else ""
    panels.draw_text(layout, context, error or note, icon="ERROR" if error else "INFO" if note else "NONE", least=SAID_LINES)


def _error(scene: bpy.types.Scene, entry: GssmcPhoto) -> str:
    """Why a photo could not be read or refined, in full; empty when all is well."""
    if entry.error or photo_list.camera_of(scene, entry):
        return entry.error
    return iface_("The camera of this photo was deleted; Remove Photo takes the line off the list.")


classes = (GSSMC_UL_photos, GSSMC_PT_photos)
