"""Render Splat: frames of the splat for the compositor."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty, StringProperty

from ..core.errors import PhotoError
from ..gssmc_addon.composite import splat_frames
from ..gssmc_addon.composite.splat_frames import SplatFramesJob
from ..gssmc_addon.jobs.operator import JobOperator
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_render_splat(JobOperator, bpy.types.Operator):
    """Render the splat through the scene camera, every frame of the timeline, to set up a composite with the splat behind"""

    bl_idname = "gssmc.render_splat"
    bl_label = "Render Splat"
    bl_options = {"UNDO"}

    __annotations__ = {
        "folder": StringProperty(
            name="Folder",
            description="Where the frames go; // is the folder of the .blend",
            subtype="DIR_PATH",
            default="//splat",
        ),
        "start": IntProperty(name="Start", description="The first frame; 0: the timeline's", default=0),
        "end": IntProperty(name="End", description="The last frame; 0: the timeline's", default=0),
    }

    def make_job(self, context: bpy.types.Context) -> SplatFramesJob:
        scene = context.scene
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        splat_frames.check_idle(scene)
        start, end = self.start or scene.frame_start, self.end or scene.frame_end
        if start > end:
            raise PhotoError(rpt_("The first frame, {start}, comes after the last, {end}.", start=start, end=end))
        views = splat_frames.views_of(scene, start, end)
        return SplatFramesJob(views, scene.gssmc.splat, splat_frames.folder_of(self.folder))

    def apply(self, context: bpy.types.Context, job: SplatFramesJob, result: Any) -> set[str]:
        if job.failed:
            frame, reason = next(iter(job.failed.items()))
            raise PhotoError(rpt_("Frame {frame} of the splat was not rendered: {reason}", frame=frame, reason=reason))
        return self.done(context, splat_frames.keep(context.scene, job, self.folder))

    def stopped(self, context: bpy.types.Context, job: SplatFramesJob) -> set[str]:
        return self.refuse(
            context, rpt_("Stopped; the frames that are done stay, and Render Splat goes on from there."), level="INFO"
        )


classes = (GSSMC_OT_render_splat,)
