"""File > Export > Photo Cameras: COLMAP text model, nerfstudio's transforms.json, Nuke's .chan, or camera JSON."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from ..gssmc_addon.camera import exchange as camera_exchange
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.splat import axes as splat_axes
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.outputs import check_export

FORMATS = (
    ("JSON", "Camera JSON", "GS-SMC's own format, with the verdicts"),
    ("NERFSTUDIO", "transforms.json", "nerfstudio and instant-ngp: camera-to-world matrices"),
    ("COLMAP", "COLMAP Text", "A folder with cameras.txt, images.txt and points3D.txt"),
    ("CHAN", "Nuke .chan", "The animated camera of one tracked plate, a line for each frame"),
)


SUFFIXES = {"JSON": ".json", "NERFSTUDIO": ".json", "COLMAP": "", "CHAN": ".chan"}


class GSSMC_OT_export_cameras(PlainOperator, bpy.types.Operator, ExportHelper):
    """Export photo cameras in the coordinates of the splat file"""

    bl_idname = "gssmc.export_cameras"
    bl_label = "Export Cameras"

    filename_ext = ".json"
    __annotations__ = {
        "filter_glob": StringProperty(default="*.json;*.txt", options={"HIDDEN"}),
        "format": EnumProperty(
            name="Format", items=FORMATS, default="JSON", description="The format that the other program reads"
        ),
        "selected": BoolProperty(
            name="Selected Only",
            default=False,
            description="The selected cameras; otherwise all of the scene that have a photo",
        ),
        "axes": EnumProperty(
            name="Axes", items=splat_axes.EXPORT_ITEMS, default="FILE", description="In which world the cameras are written"
        ),
        "world": StringProperty(
            name="Training World",
            subtype="FILE_PATH",
            description="nerfstudio's dataparser_transforms.json: cameras are written in the world of its transforms.json, "
            "instead of the splat's",
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.gssmc.splat is None:
            cls.poll_message_set("Exported poses are in the splat's coordinates; import or pick a splat first")
            return False
        return True

    def check(self, context: bpy.types.Context) -> bool:
        self.filename_ext = SUFFIXES[self.format]
        return super().check(context) if self.filename_ext else False

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()
        path = Path(bpy.path.abspath(self.filepath))
        if path.suffix in SUFFIXES.values() and path.suffix != SUFFIXES[self.format]:
            path = path.with_suffix(SUFFIXES[self.format])
        check_export(path)
        outgoing = camera_exchange.collect(context.scene, self._objects(context))
        if self.axes == "TRAINING":
            outgoing = camera_exchange.into_training_axes(outgoing, context.scene.gssmc.splat)
        if self.world:
            outgoing = camera_exchange.out_of_training_world(outgoing, Path(bpy.path.abspath(self.world)))
        wrote = camera_exchange.write(path, self.format, outgoing)
        return self.done(context, " ".join(wrote), "INFO" if len(wrote) == 1 else "WARNING")

    def _objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        source = context.selected_objects if self.selected else context.scene.objects
        cameras = [o for o in source if o.type == "CAMERA"]
        return cameras if self.selected else [o for o in cameras if photo_image.camera_photo(o) or plate_source.has_clip(o)]


classes = (GSSMC_OT_export_cameras,)
