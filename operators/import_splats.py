"""File > Import > Gaussian Splats: a worker thread in the window, a plain call in scripts and background mode."""

import time
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.errors import GssmcError
from ..core.render import memory
from ..gssmc_addon.refine import panel as panels
from ..gssmc_addon.registration import preferences
from ..gssmc_addon.splat import display as splat_display
from ..gssmc_addon.splat import importer as splat_import
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.splat.import_job import ImportJob
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import iface_, rpt_
from ..gssmc_addon.viewport import props as viewport_props

ORIENTATION_ITEMS = (
    ("AUTO", "By Format", "What the file's format means, or the file declares: .ply and .splat y down, .spz y up"),
    ("Y_DOWN", "Y Down", "The file's y axis points down, as photogrammetry and most splat trainers write it"),
    ("Y_UP", "Y Up", "The file's y axis points up"),
    ("Z_UP", "Z Up", "The file's z axis points up, as in Blender: keep the axes"),
    ("Z_DOWN", "Z Down", "The file's z axis points down"),
)
TICK_S = 0.03
STEP_S = 0.05  # of each tick, for writing into Blender's memory, which may take one attribute longer
DIALOG_WIDTH = 340
READING = 0.8  # share of the progress shown


class GSSMC_OT_import_splats(PlainOperator, bpy.types.Operator, ImportHelper):
    """Import a 3D Gaussian Splatting scan as a point cloud"""

    bl_idname = "gssmc.import_splats"
    bl_label = "Import Gaussian Splats"
    bl_options = {"UNDO", "PRESET"}

    filter_glob: StringProperty(default=splat_import.FILTER, options={"HIDDEN"})
    orientation: EnumProperty(
        name="Up Axis", items=ORIENTATION_ITEMS, default="AUTO", description="Turns the object; the file's coordinates stay"
    )
    scale: FloatProperty(
        name="Scale",
        default=1.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=100.0,
        description="Scales the object; the file's coordinates stay",
    )
    max_shown: IntProperty(
        name="Most Shown",
        default=viewport_props.MAX_SHOWN,
        min=1000,
        description="Most Gaussians drawn in the viewport; all are imported. The panel changes it later",
    )
    show_colours: BoolProperty(
        name="Colours of Points",
        default=True,
        description="Where the scan shows as points, switch Solid viewports to Material Preview, which has its colours",
    )

    wait: BoolProperty(
        name="Wait",
        default=True,
        options={"HIDDEN", "SKIP_SAVE"},
        description="For scripts: return when all is imported. Off, a window goes on meanwhile, as it does after the dialog",
    )

    def invoke(self, context, event):
        self.wait = False
        if self.filepath:  # dropped on the viewport
            title = iface_("Import {file}", file=Path(self.filepath).name)
            return context.window_manager.invoke_props_dialog(self, width=DIALOG_WIDTH, title=title, confirm_text="Import")
        return super().invoke(context, event)

    def check(self, context):
        return True  # the file was changed: draw() describes it anew

    def draw(self, context):
        self.layout.use_property_split = True
        for line in splat_import.describe(self.filepath):
            panels.draw_text(self.layout, context, line)
        for name in ("orientation", "scale", "max_shown"):
            self.layout.prop(self, name)
        if not viewport_props.is_drawable():
            self.layout.prop(self, "show_colours")

    def run(self, context):
        """After the dialog the file comes in beside other work; a call from a script waits for it."""
        self._building = None
        memory.check("The import", memory.import_bytes(Path(self.filepath)), preferences.memory_limit(context))
        self._job = ImportJob(Path(self.filepath), viewport_props.is_drawable())
        self._job.start()
        if not (self.wait or bpy.app.background) and context.window is not None:
            manager = context.window_manager
            self._timer = manager.event_timer_add(TICK_S, window=context.window)
            manager.progress_begin(0, 100)
            if context.workspace:
                context.workspace.status_text_set(iface_("Importing {file}    Esc: cancel", file=self._job.path.name))
            manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        self._job.join()
        self._job.look()  # a failure comes before anything is made
        self._begin_building(self._job.read())
        while not self._building.step():
            pass
        return self._finish(context)

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "The import was cancelled; nothing was changed.")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            if not self._advance(context):
                return {"PASS_THROUGH"}
            self._end(context)
            return self._finish(context)
        except GssmcError as error:
            self.cancel(context)
            return self.refuse(str(error))

    def cancel(self, context):
        """The user or Blender ends the operator."""
        self._job.stop()
        if self._building:
            self._building.drop()
        self._building = self._scene = None  # as at the end
        self._end(context)

    def _advance(self, context):
        """True when all of the file is in Blender's memory, and its look is known."""
        until = time.perf_counter() + STEP_S
        if self._building is None:
            read = self._job.read()
            if read is None:
                self._say(context, READING * self._job.fraction)
                return False
            self._begin_building(read)
            return False  # Blender draws anew
        while not self._complete:
            self._complete = self._building.step()
            self._say(context, READING + (1 - READING) * self._building.fraction)
            if time.perf_counter() > until:
                return False
        return self._job.done()

    def _begin_building(self, read):
        placement = splat_import.Placement(self.orientation, self.scale, self.max_shown)
        self._scene, self._complete = read.scene, False
        self._building = splat_import.Building(self._job.path.stem, read, placement)

    def _finish(self, context):
        obj, scene = self._building.finish(context, self._job.look()), self._scene
        self._building = self._scene = self._job = None  # the operator outlives its work in Blender's history
        if self.show_colours and not (viewport_props.is_drawable() or splat_object.is_native(obj.data)):
            splat_display.show_colours(context)
        values = {"name": obj.name, "count": len(scene), "degree": scene.sh_degree, "format": scene.format}
        words = [rpt_('"{name}": {count:,} Gaussians, SH degree {degree} ({format}).', **values)]
        if scene.dropped:
            words.append(rpt_("{count} Gaussians with values that are not finite were left out.", count=scene.dropped))
        return self.done(context, " ".join(words))

    def _say(self, context, fraction):
        """At the mouse: without a graphics card, each redraw of the status bar holds the window up for 0.1 s."""
        context.window_manager.progress_update(100 * fraction)

    def _end(self, context):
        if self._timer is None:
            return
        context.window_manager.event_timer_remove(self._timer)
        self._timer = None
        context.window_manager.progress_end()
        if context.workspace:
            context.workspace.status_text_set(None)


classes = (GSSMC_OT_import_splats,)
