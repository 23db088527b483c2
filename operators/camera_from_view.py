"""Camera From View: the viewport's view becomes the start."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty
from mathutils import Matrix

from ..core.errors import CameraError
from ..gssmc_addon.camera import channels as camera_channels
from ..gssmc_addon.camera import frame as camera_frame
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.support.operator_parts import PlainOperator
from ..gssmc_addon.support.texts import n_, rpt_

NO_VIEW = n_("There is no 3D viewport to take the view from; open one")


class GSSMC_OT_camera_from_view(PlainOperator, bpy.types.Operator):
    """Put the scene's camera where the viewport looks from; its lens stays. Without a camera, a new one with the view's lens"""

    bl_idname = "gssmc.camera_from_view"
    bl_label = "Camera From View"
    bl_options = {"UNDO"}

    __annotations__ = {
        "new": BoolProperty(name="New Camera", default=False, description="Make a new camera instead of moving the scene's"),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        view = photo_camera.find_view(context)
        if view is None:
            cls.poll_message_set(NO_VIEW)
        elif not view.is_free:
            cls.poll_message_set("The view looks through the camera already; turn it first")
        return view is not None and view.is_free

    def run(self, context: bpy.types.Context) -> set[str]:
        scene, view = context.scene, photo_camera.find_view(context)
        if view is None:
            raise CameraError(rpt_(NO_VIEW))
        camera = scene.camera
        if self.new or camera is None or camera.type != "CAMERA":
            render = scene.render
            camera = photo_camera.new_camera(context, "Camera", view, (render.resolution_x, render.resolution_y))
            camera_frame.release(camera.data)  # as long as there is no photo
            scene.camera = camera
        camera_channels.check_writable(camera)
        camera.matrix_world = Matrix(view.region.view_matrix).inverted()
        context.view_layer.update()
        keyed = camera_channels.write_keyframes(scene, camera)
        view.region.view_perspective = "CAMERA"
        moved = rpt_('"{name}" stands where the view was.', name=camera.name)
        return self.done(context, f"{moved} {keyed}".strip())


classes = (GSSMC_OT_camera_from_view,)
