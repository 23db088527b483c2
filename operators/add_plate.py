"""Add Plate: a camera for an image sequence or a movie."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.errors import GssmcError
from ..core.plate import open_plate
from ..gssmc_addon import jobs, photo_camera, plate_source
from .add_photo import CAMERA_ITEMS


class GSSMC_OT_add_plate(bpy.types.Operator, ImportHelper):
    """Load a movie or a numbered image sequence and set it behind a camera, from the current frame on"""

    bl_idname = "gssmc.add_plate"
    bl_label = "Add Plate"
    bl_options = {"UNDO"}

    filter_image: BoolProperty(default=True, options={"HIDDEN"})
    filter_movie: BoolProperty(default=True, options={"HIDDEN"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    camera: EnumProperty(name="Camera", items=CAMERA_ITEMS, default="AUTO")
    camera_file: StringProperty(
        name="Camera File",
        subtype="FILE_PATH",
        description="Optional JSON file of cameras; the one that names the chosen file gives lens, distortion and start pose",
    )
    set_resolution: BoolProperty(
        name="Set Resolution",
        default=True,
        description="Make the render resolution the plate's, so that it fills the camera's frame",
    )

    @classmethod
    def poll(cls, context):
        if jobs.active():
            cls.poll_message_set("A refinement or another job is running; wait for it or cancel it")
            return False
        return True

    def check(self, context):
        return False  # ImportHelper would append a file extension

    def execute(self, context):
        context.view_layer.update()  # scripts place objects and expect that to count
        scene, path = context.scene, Path(bpy.path.abspath(self.filepath))
        try:
            plate, first, last = open_plate(path)
            photo = plate_source.frame_source(plate, first).read()
            given = photo_camera.find_camera(scene, self.camera_file, photo) if self.camera_file else None
            image = plate_source.load(plate.file(first), plate.is_movie)
            camera = photo_camera.choose_camera(context, self.camera, path.name, photo)
            photo_camera.fit_camera(context, camera, photo, image, given, self.set_resolution)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        plate_source.set_frames(camera.data, image, scene.frame_current, first, last)
        photo_camera.look_through(context, camera)
        end = scene.frame_current + last - first
        self.report({"INFO"}, f'"{image.name}" is set behind "{camera.name}", frames {scene.frame_current} to {end}.')
        return {"FINISHED"}


classes = (GSSMC_OT_add_plate,)
