"""Find Camera: as Refine Camera, from anywhere."""

import bpy
from bpy.props import StringProperty

from ..core.locate import FindReport
from ..gssmc_addon.find import job as find_job
from ..gssmc_addon.find.job import FindJob
from ..gssmc_addon.jobs.operator import JobOperator
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.operator_parts import NeedsPhoto
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_find_camera(NeedsPhoto, JobOperator, bpy.types.Operator):
    """Find the exact camera of the photo, wherever the camera stands now. The view from there is looked at first, and refined
    where it matches the photo; then those of solved photos; then a map of the whole scan, which is kept for the next photo"""

    bl_idname = "gssmc.find_camera"
    bl_label = "Find Camera"
    bl_options = {"UNDO"}  # no REGISTER: the redo panel would run it again, blocking

    __annotations__ = {
        "splat": StringProperty(name="Splat", description="Name of the splat object; empty: the one picked in the panel"),
        "camera": StringProperty(name="Camera", description="Name of the camera object; empty: the scene camera"),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    def make_job(self, context: bpy.types.Context) -> FindJob:
        scene = context.scene
        splat = bpy.data.objects.get(self.splat) if self.splat else scene.gssmc.splat
        camera = bpy.data.objects.get(self.camera) if self.camera else scene.camera
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        job = find_job.prepare(scene, splat, camera, settings_props.settings_from(scene.gssmc, self.properties))
        problem.begin(self.bl_label)
        return job

    def apply(self, context: bpy.types.Context, job: FindJob, report: FindReport) -> set[str]:
        message, how = find_job.apply_report(job.targets, report), find_job.how_found(job.finder, report)
        how = " ".join(filter(None, [how, job.inputs.splat.remark]))
        level = "WARNING" if report.verdict != "trusted" else "INFO"
        done = self.done(context, f"{message} {how}".strip(), level, line=how)
        return {"CANCELLED"} if report.verdict == "failed" else done

    def stopped(self, context: bpy.types.Context, job: FindJob) -> set[str]:
        return self.refuse(context, rpt_("The search was cancelled; the camera was not changed."), level="INFO")


classes = (GSSMC_OT_find_camera,)
