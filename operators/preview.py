"""Preview: the splat through the photo's camera, set against the photo."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..core.errors import RefineError
from ..gssmc_addon.jobs.operator import JobOperator
from ..gssmc_addon.preview import images as preview_images
from ..gssmc_addon.preview import job as preview_job
from ..gssmc_addon.preview import options as preview_options
from ..gssmc_addon.preview import show as preview_show
from ..gssmc_addon.preview import watch as preview_watch
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.support.operator_parts import NeedsPhoto
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_preview(NeedsPhoto, JobOperator, bpy.types.Operator):
    """Render the splat through the camera and set it against the photo"""

    bl_idname = "gssmc.preview"
    bl_label = "Preview"
    bl_options = {"UNDO"}

    __annotations__ = {
        "camera": StringProperty(name="Camera", description="Name of the camera object; empty: the scene camera"),
        **preview_options.preview_annotations(),
    }

    def make_job(self, context: bpy.types.Context) -> preview_job.PreviewJob:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        scene, own = context.scene, context.window_manager.gssmc.preview
        said_background = self.properties.is_property_set("background")
        for name in preview_options.preview_annotations():  # Options that were not given are taken from the panel.
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(own, name))
        if not said_background and self.style not in preview_options.IN_VIEWPORT:
            self.background = False  # The panel does not show this switch for these styles.
        if self.background and self.style not in preview_options.IN_VIEWPORT:
            raise RefineError(rpt_("This style shows in an Image Editor only; for the viewport choose another style."))
        camera = bpy.data.objects.get(self.camera) if self.camera else scene.camera
        if self.camera and camera is None:
            raise RefineError(rpt_('There is no camera "{name}"; give the name of a camera object.', name=self.camera))
        self._camera = camera.name if camera else ""
        return preview_job.prepare(context, camera, preview_job.options_of(self), settings_props.settings_from(scene.gssmc))

    def apply(self, context: bpy.types.Context, job: preview_job.PreviewJob, result: preview_job.Preview) -> set[str]:
        camera = context.scene.objects.get(self._camera)
        if camera is None or camera.type != "CAMERA":
            raise RefineError(rpt_('The camera "{name}" was removed while its preview was rendered.', name=self._camera))
        if result.new:
            preview_images.put_pair(result.pair, job.inputs.key)
        image = preview_images.find("render") if self.style == "FLICKER" else None
        if image is None:
            image = preview_images.put_picture(result.picture)
        shown = preview_images.show(image)
        if self.background:
            preview_watch.mark(camera, job.inputs.camera, image)
            preview_show.look_through(context, camera)
        preview_images.show_in_viewport(camera.data, image if self.background else None)
        sentences, seen = [preview_show.told(camera, result)], shown or self.background
        context.window_manager.gssmc.preview.flicker = self.style == "FLICKER" and seen
        if not seen:
            sentences.append(rpt_('Open an Image Editor and pick "{image}" in its header to see it.', image=image.name))
        return self.done(context, " ".join(sentences), line="" if seen and not result.matches else " ".join(sentences))

    def stopped(self, context: bpy.types.Context, job: preview_job.PreviewJob) -> set[str]:
        return self.refuse(context, rpt_("The preview was cancelled."), level="INFO")


classes = (GSSMC_OT_preview,)
