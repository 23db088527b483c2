"""File > Import > Gaussian Splats."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.errors import GssmcError
from ..core.splats import read_splats
from ..gssmc_addon import panels, splat_display, splat_import, splat_object

ORIENTATION_ITEMS = (
    ("AUTO", "By Format", "What the file's format means, or the file declares: .ply and .splat y down, .spz y up"),
    ("Y_DOWN", "Y Down", "The file's y axis points down, as photogrammetry and most splat trainers write it"),
    ("Y_UP", "Y Up", "The file's y axis points up"),
    ("Z_UP", "Z Up", "The file's z axis points up, as in Blender: keep the axes"),
    ("Z_DOWN", "Z Down", "The file's z axis points down"),
)


class GSSMC_OT_import_splats(bpy.types.Operator, ImportHelper):
    """Import a 3D Gaussian Splatting scan as a point cloud"""

    bl_idname = "gssmc.import_splats"
    bl_label = "Import Gaussian Splats"
    bl_options = {"UNDO", "PRESET"}

    filter_glob: StringProperty(default=splat_import.FILTER, options={"HIDDEN"})
    orientation: EnumProperty(
        name="Up Axis", items=ORIENTATION_ITEMS, default="AUTO", description="Turns the object; the file's coordinates stay"
    )
    show_colours: BoolProperty(
        name="Show Colours",
        default=True,
        description="Switch Solid viewports to Material Preview, where the scan shows its colours",
    )

    def invoke(self, context, event):
        if self.filepath:  # dropped on the viewport
            return self.invoke_popup(context)
        return super().invoke(context, event)

    def check(self, context):
        return True  # the file was changed: draw() describes it anew

    def draw(self, context):
        self.layout.use_property_split = True
        for line in splat_import.describe(self.filepath):
            panels.draw_text(self.layout, context, line)
        self.layout.prop(self, "orientation")
        self.layout.prop(self, "show_colours")

    def execute(self, context):
        path = Path(self.filepath)
        try:
            scene = read_splats(path)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        obj = splat_import.add_splat(context, path.stem, scene, self.orientation)
        if self.show_colours and not splat_object.has_native_type(obj.data):
            splat_display.show_colours(context)
        dropped = f" {scene.dropped} Gaussians with values that are not finite were left out." if scene.dropped else ""
        self.report({"INFO"}, f'"{obj.name}": {len(scene):,} Gaussians, SH degree {scene.sh_degree} ({scene.format}).{dropped}')
        return {"FINISHED"}


classes = (GSSMC_OT_import_splats,)
