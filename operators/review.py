"""Next Photo and Previous Photo: looks through the next camera of the list."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, IntProperty

from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo.entry import GssmcPhoto
from ..gssmc_addon.support.texts import tip_


class GSSMC_OT_review(bpy.types.Operator):
    """Look through the camera of the next or previous photo of the list"""

    bl_idname = "gssmc.review"
    bl_label = "Next Photo"
    bl_options = {"UNDO"}

    __annotations__ = {
        "step": IntProperty(name="Step", default=1, description="1 for the next photo of the list, -1 for the previous one"),
        "skip_trusted": BoolProperty(name="Skip Trusted", default=False, description="Only photos whose camera is not trusted"),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return photo_list.poll(cls, context.scene)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if properties.step > 0:
            next_unsure = tip_("Look through the camera of the next photo of the list whose camera is not trusted")
            return next_unsure if properties.skip_trusted else tip_("Look through the camera of the next photo of the list")
        before_unsure = tip_("Look through the camera of the previous photo of the list whose camera is not trusted")
        return before_unsure if properties.skip_trusted else tip_("Look through the camera of the previous photo of the list")

    def execute(self, context: bpy.types.Context) -> set[str]:
        own = context.scene.gssmc
        count, way = len(own.photos), 1 if self.step >= 0 else -1
        for k in range(abs(self.step) or 1, count + 1):
            index = (own.photo_index + way * k) % count
            if self._wanted(context.scene, own.photos[index]):
                own.photo_index = index  # The update function of the property looks through the camera.
                return {"FINISHED"}
        self.report({"INFO"}, "All photos of the list are trusted.")
        return {"CANCELLED"}

    def _wanted(self, scene: bpy.types.Scene, entry: GssmcPhoto) -> bool:
        return photo_list.camera_of(scene, entry) is not None and (photo_list.is_open(entry) or not self.skip_trusted)


classes = (GSSMC_OT_review,)
