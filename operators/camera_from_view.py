"""Camera From View: the viewport's view becomes the start."""

import bpy
from bpy.props import BoolProperty
from mathutils import Matrix

from ..core.errors import GssmcError
from ..gssmc_addon import camera_channels, photo_camera

NO_VIEW = "There is no 3D viewport to take the view from"


class GSSMC_OT_camera_from_view(bpy.types.Operator):
    """Put the scene's camera where the viewport looks from; its lens stays. Without a camera, a new one with the view's lens"""

    bl_idname = "gssmc.camera_from_view"
    bl_label = "Camera From View"
    bl_options = {"UNDO"}

    new: BoolProperty(name="New Camera", default=False, description="Make a new camera instead of moving the scene's")

    @classmethod
    def poll(cls, context):
        view = photo_camera.find_view(context)
        if view is None or not view.is_free:
            cls.poll_message_set(NO_VIEW if view is None else "The view looks through the camera already; turn it first")
            return False
        return True

    def execute(self, context):
        scene, view = context.scene, photo_camera.find_view(context)
        camera = scene.camera
        try:
            if self.new or camera is None or camera.type != "CAMERA":
                render = scene.render
                camera = photo_camera.new_camera(context, "Camera", view, (render.resolution_x, render.resolution_y))
                scene.camera = camera
            camera_channels.check_writable(camera)
        except GssmcError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        camera.matrix_world = Matrix(view.region.view_matrix).inverted()
        context.view_layer.update()
        keyed = camera_channels.write_keyframes(scene, camera)
        view.region.view_perspective = "CAMERA"
        self.report({"INFO"}, f'"{camera.name}" stands where the view was. {keyed}'.strip())
        return {"FINISHED"}


classes = (GSSMC_OT_camera_from_view,)
