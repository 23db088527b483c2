"""Refine Camera: runs beside the window, and blocks in scripts and background mode."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from ..core.pose.report import RefineReport
from ..gssmc_addon.find import job as find_job
from ..gssmc_addon.jobs.operator import JobOperator
from ..gssmc_addon.refine import job as refine_job
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.operator_parts import NeedsPhoto
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_refine(NeedsPhoto, JobOperator, bpy.types.Operator):
    """Find the exact camera of the photo, starting from where the camera stands. Where that fails, it is searched for in the
    whole scan, as Find Camera does"""

    bl_idname = "gssmc.refine"
    bl_label = "Refine Camera"
    bl_options = {"UNDO"}  # Without REGISTER, because the redo panel would run it again and block.

    __annotations__ = {
        "splat": StringProperty(name="Splat", description="Name of the splat object; empty: the one picked in the panel"),
        "camera": StringProperty(name="Camera", description="Name of the camera object; empty: the scene camera"),
        "locate": BoolProperty(
            name="Search the Scan",
            default=True,
            description="Where no camera is found from where it stands, it is searched for in the whole scan",
        ),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    def make_job(self, context: bpy.types.Context) -> refine_job.RefineJob:
        scene = context.scene
        splat = bpy.data.objects.get(self.splat) if self.splat else scene.gssmc.splat
        camera = bpy.data.objects.get(self.camera) if self.camera else scene.camera
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        prepare = find_job.prepare_refinement if self.locate else refine_job.prepare
        job = prepare(scene, splat, camera, settings_props.settings_from(scene.gssmc, self.properties))
        problem.begin(self.bl_label)
        return job

    def apply(self, context: bpy.types.Context, job: refine_job.RefineJob, report: RefineReport) -> set[str]:
        remark = job.inputs.splat.remark
        message = refine_job.apply_report(job.targets, report, remark)
        level = "WARNING" if report.verdict != "trusted" else "INFO"
        done = self.done(context, message, level, line=remark)  # the panel shows the verdict
        return {"CANCELLED"} if report.verdict == "failed" else done

    def stopped(self, context: bpy.types.Context, job: refine_job.RefineJob) -> set[str]:
        return self.refuse(context, rpt_("The refinement was cancelled; nothing was changed."), level="INFO")


classes = (GSSMC_OT_refine,)
