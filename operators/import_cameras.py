"""File > Import > Photo Cameras: start cameras from COLMAP, nerfstudio or JSON."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.errors import GssmcError
from ..gssmc_addon import camera_bridge, camera_exchange


class GSSMC_OT_import_cameras(bpy.types.Operator, ImportHelper):
    """Import cameras, with their photos, from a COLMAP text model, transforms.json or camera JSON of the splat's own world"""

    bl_idname = "gssmc.import_cameras"
    bl_label = "Import Photo Cameras"
    bl_options = {"UNDO"}

    filter_glob: StringProperty(default="*.json;*.txt", options={"HIDDEN"})
    photos: StringProperty(
        name="Photos",
        subtype="DIR_PATH",
        description="Folder of the photos; empty: beside the file, or in a folder named images near it",
    )
    set_resolution: BoolProperty(
        name="Set Resolution", default=False, description="Make the render resolution that of the first camera's photo"
    )

    @classmethod
    def poll(cls, context):
        if context.scene.gssmc.splat is None:
            cls.poll_message_set(camera_exchange.NO_SPLAT)
            return False
        return True

    def check(self, context):
        return False  # ImportHelper would append a file extension

    def execute(self, context):
        context.view_layer.update()
        path = Path(bpy.path.abspath(self.filepath))
        photos = Path(bpy.path.abspath(self.photos)) if self.photos else None
        try:
            camera_bridge.splat_similarity(context.scene.gssmc.splat)
            found, left_out = camera_exchange.gather(path, photos)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        camera_exchange.add_cameras(context, path.stem or path.name, found, self.set_resolution)
        shown = sum(item.file is not None for item in found)
        more = f" {left_out} without a lens were left out." if left_out else ""
        self.report({"INFO"}, f'{len(found)} cameras from "{path.name}", {shown} of them with their photo.{more}')
        return {"FINISHED"}


classes = (GSSMC_OT_import_cameras,)
