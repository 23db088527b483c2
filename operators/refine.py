"""Refine Camera: a worker thread in the window, a plain call in scripts and background mode."""

import bpy
from bpy.props import StringProperty

from ..core.errors import GssmcError
from ..gssmc_addon import jobs, photo_image, properties


class GSSMC_OT_refine(bpy.types.Operator):
    """Find the exact camera of the photo, starting from where the camera stands"""

    bl_idname = "gssmc.refine"
    bl_label = "Refine Camera"
    bl_options = {"UNDO"}  # no REGISTER: the redo panel would run it again, blocking

    __annotations__ = {
        "splat": StringProperty(name="Splat", description="Name of the splat object; empty: the one picked in the panel"),
        "camera": StringProperty(name="Camera", description="Name of the camera object; empty: the scene camera"),
        **properties.settings_annotations(),
        **properties.model_annotations(),
    }

    @classmethod
    def poll(cls, context):
        if jobs.active():
            cls.poll_message_set("A refinement is running")
            return False
        return True

    def execute(self, context):
        """Blocking; the way of scripts and background mode."""
        try:
            job = self._gather(context)
            return self._apply(context, job, job.run())
        except GssmcError as error:
            return self._refuse(context, str(error))

    def invoke(self, context, event):
        try:
            job = self._gather(context)
        except GssmcError as error:
            return self._refuse(context, str(error))
        self._note(context, "")
        jobs.begin(context, job)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        job = jobs.active()
        if job is None:  # ended from outside: another file was opened
            return {"CANCELLED"}
        if event.type == "ESC" or job.cancelled:
            job.cancel()
            jobs.end(job)
            return self._refuse(context, "The refinement was cancelled; nothing was changed.", level="INFO")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            report = job.tick()
            if report is None:
                return {"PASS_THROUGH"}
            jobs.end(job)
            return self._apply(context, job, report)
        except GssmcError as error:
            jobs.end(job)
            return self._refuse(context, str(error))

    def cancel(self, context):
        """Blender ends the operator: the window closes, or another file is opened."""
        job = jobs.active()
        if job:
            job.cancel()
            jobs.end(job)

    def _gather(self, context):
        scene = context.scene
        splat = bpy.data.objects.get(self.splat) if self.splat else scene.gssmc.splat
        camera = bpy.data.objects.get(self.camera) if self.camera else scene.camera
        photo = photo_image.camera_photo(camera) if camera and camera.type == "CAMERA" else None
        context.view_layer.update()  # scripts set locations and expect them to count
        return jobs.gather(scene, splat, camera, photo, properties.settings_from(scene.gssmc, self.properties))

    def _apply(self, context, job, report):
        message = jobs.apply_report(job.targets, report)
        self._note(context, "")  # the verdict on the camera says it all
        self.report({"WARNING" if report.verdict != "trusted" else "INFO"}, message)
        return {"CANCELLED" if report.verdict == "failed" else "FINISHED"}

    def _refuse(self, context, message, level="ERROR"):
        self._note(context, message, level)
        self.report({level}, message)
        return {"CANCELLED"}

    def _note(self, context, message, icon="INFO"):
        context.window_manager.gssmc.message = message
        context.window_manager.gssmc.message_icon = icon


classes = (GSSMC_OT_refine,)
