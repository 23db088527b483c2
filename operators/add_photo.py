"""Add Photo: a camera for a photograph, with the photo behind it."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..core.errors import GssmcError
from ..gssmc_addon import photo_camera, photo_image, photo_list

CAMERA_ITEMS = (
    (
        "AUTO",
        "Automatic",
        "The scene camera while it has no photo and you look through it, else a new camera at the current view",
    ),
    ("NEW", "New Camera", "A new camera at the current view"),
    ("SCENE", "Scene Camera", "The scene camera, where it stands"),
)


class GSSMC_OT_add_photo(bpy.types.Operator, ImportHelper):
    """Load a photograph and set it behind a camera, ready to be refined"""

    bl_idname = "gssmc.add_photo"
    bl_label = "Add Photo"
    bl_options = {"UNDO"}

    filter_image: BoolProperty(default=True, options={"HIDDEN"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    camera: EnumProperty(name="Camera", items=CAMERA_ITEMS, default="AUTO")
    camera_file: StringProperty(
        name="Camera File",
        subtype="FILE_PATH",
        description="Optional JSON file of cameras; the one that names this photo gives lens, distortion and start pose",
    )
    set_resolution: BoolProperty(
        name="Set Resolution",
        default=False,
        description="Make the render resolution the photo's, so that it fills the camera's frame. Without, the photo lies in "
        "the middle of the frame as large as fits",
    )

    def check(self, context):
        return False  # ImportHelper would append a file extension

    def execute(self, context):
        context.view_layer.update()  # scripts place objects and expect that to count
        try:
            photo = photo_image.read_any_photo(self.filepath)
            given = photo_camera.find_camera(context.scene, self.camera_file, photo) if self.camera_file else None
            image = photo_image.load_image(self.filepath, photo)
            camera = photo_camera.choose_camera(context, self.camera, image.name, photo)
            notes = photo_camera.fit_camera(context, camera, photo, image, given, self.set_resolution)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        photo_list.note(context.scene, camera, photo)
        photo_camera.look_through(context, camera)
        self.report(
            {"INFO"}, f'"{image.name}" ({photo.width} x {photo.height}) is set behind "{camera.name}". ' + " ".join(notes)
        )
        return {"FINISHED"}


classes = (GSSMC_OT_add_photo,)
