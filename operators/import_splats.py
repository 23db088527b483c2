"""File > Import > Gaussian Splats: runs beside the window, and blocks in scripts and background mode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.render import memory
from ..core.splats.sog.container import STREAMED
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.refine import panel as panels
from ..gssmc_addon.registration import preferences
from ..gssmc_addon.splat import display as splat_display
from ..gssmc_addon.splat import importer as splat_import
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.splat.import_job import SplatImport
from ..gssmc_addon.splat.import_options import import_annotations, summary
from ..gssmc_addon.support.texts import iface_, rpt_
from ..gssmc_addon.viewport import props as viewport_props

DIALOG_WIDTH = 340


class GSSMC_OT_import_splats(AskingJobOperator, bpy.types.Operator, ImportHelper):
    """Import a 3D Gaussian Splatting scan as a point cloud"""

    bl_idname = "gssmc.import_splats"
    bl_label = "Import Splats"  # This is also the file browser's button, which cuts off longer names.
    bl_options = {"UNDO", "PRESET"}

    __annotations__ = {
        "filter_glob": StringProperty(default=splat_import.FILTER, options={"HIDDEN"}),
        **import_annotations(),
    }

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.wait = False
        if self.filepath:  # dropped on the viewport
            title = iface_("Import {file}", file=Path(self.filepath).name)
            return context.window_manager.invoke_props_dialog(self, width=DIALOG_WIDTH, title=title, confirm_text="Import")
        return ImportHelper.invoke(self, context, event)

    def check(self, context: bpy.types.Context) -> bool:
        return True  # Another file was chosen, and draw() has to describe it.

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        for line in splat_import.describe(self.filepath):
            panels.draw_text(self.layout, context, line)
        for name in ("orientation", "scale", "max_shown"):
            self.layout.prop(self, name)
        if Path(self.filepath).name == STREAMED:
            self.layout.prop(self, "level")
        if not viewport_props.is_drawable():
            self.layout.prop(self, "show_colours")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """After the dialog the file comes in beside other work; a call from a script waits for it."""
        self.asked = not (self.wait or bpy.app.background or context.window is None)
        return super().execute(context)

    def make_job(self, context: bpy.types.Context) -> SplatImport:
        path = Path(self.filepath)
        memory.check("The import", memory.import_bytes(path), preferences.memory_limit(context))
        placement = splat_import.Placement(self.orientation, self.scale, self.max_shown, self.level)
        return SplatImport(path, placement, viewport_props.is_drawable())

    def apply(self, context: bpy.types.Context, job: SplatImport, result: Any) -> set[str]:
        obj, scene = job.finish(context)
        if self.show_colours and not (viewport_props.is_drawable() or splat_object.is_native(obj.data)):
            splat_display.show_colours(context)
        return self.done(context, summary(obj, scene))

    def stopped(self, context: bpy.types.Context, job: SplatImport) -> set[str]:
        return self.refuse(context, rpt_("The import was cancelled; nothing was changed."), level="INFO")


classes = (GSSMC_OT_import_splats,)
