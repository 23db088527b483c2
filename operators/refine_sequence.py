"""Refine Plate: the camera of a moving plate, as keyframes."""

from __future__ import annotations

from typing import Any

import bpy

from ..gssmc_addon.camera import channels as camera_channels
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.plate import options as plate_options
from ..gssmc_addon.plate import result as plate_result
from ..gssmc_addon.plate.job import SequenceJob
from ..gssmc_addon.plate.options import AsksForRange
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.support import problem


class GSSMC_OT_refine_sequence(AsksForRange, AskingJobOperator, bpy.types.Operator):
    """Find the camera of a movie or image sequence every few frames, each from its neighbour's answer"""

    bl_idname = "gssmc.refine_sequence"
    bl_label = "Refine Plate"
    bl_options = {"UNDO"}

    __annotations__ = {
        **plate_options.plate_annotations(),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        column = self.layout.column(align=True)
        for name in ("start", "end", "step"):
            column.prop(self, name)
        column = self.layout.column()
        for name in ("smooth_frames", "every_frame", "find_start", "key_lens"):
            column.prop(self, name)

    def make_job(self, context: bpy.types.Context) -> SequenceJob:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        scene = context.scene
        splat_object.picked(scene, scene.gssmc.splat)
        options = plate_options.options_of(self, scene)
        camera_channels.check_writable(scene.camera)
        settings = settings_props.settings_from(scene.gssmc, self.properties)
        job = SequenceJob(scene, scene.camera, options, settings)
        problem.begin(self.bl_label, job.reports)
        return job

    def apply(self, context: bpy.types.Context, job: SequenceJob, result: Any) -> set[str]:
        message, trusted = plate_result.write(job)
        return self.done(context, message, "INFO" if trusted else "WARNING")


classes = (GSSMC_OT_refine_sequence,)
