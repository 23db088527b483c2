"""Track Plate: the camera of every frame of a moving plate, as keyframes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ..core.track import TrackSettings
from ..gssmc_addon.camera import channels as camera_channels
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.plate import options as plate_options
from ..gssmc_addon.plate.options import AsksForRange
from ..gssmc_addon.plate.track import pins
from ..gssmc_addon.plate.track import result as track_result
from ..gssmc_addon.plate.track.job import TrackJob, TrackOptions
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.texts import rpt_

FOCAL_ITEMS = (
    ("fixed", "Fixed", "One focal length for the whole shot"),
    ("breathing", "Breathing", "A lens whose picture grows a little as it is focused"),
    ("zoom", "Zoom", "A lens that zooms"),
)


class GSSMC_OT_track_plate(AsksForRange, AskingJobOperator, bpy.types.Operator):
    """Find the camera of every frame of a movie or image sequence, beginning at the frame that is shown"""

    bl_idname = "gssmc.track_plate"
    bl_label = "Track Plate"
    bl_options = {"UNDO"}

    __annotations__ = {
        **plate_options.range_annotations(),
        "rolling_shutter": BoolProperty(
            name="Rolling Shutter",
            description="Solve for the time that the camera takes to read a frame out, from the first row to the last",
            default=False,
        ),
        "focal": EnumProperty(
            name="Focal Length",
            items=FOCAL_ITEMS,
            default="fixed",
            description="Whether the focal length changes over the shot; where it does, it is keyed",
        ),
        "live": BoolProperty(
            name="Live Camera",
            description="Show the frames and the camera while they are tracked. Go to another frame to stop that",
            default=True,
        ),
        "smooth_frames": FloatProperty(
            name="Smooth (frames)",
            description="Removes shaking of the path that is shorter than this many frames; 0: none, the camera as it was",
            default=0,
            min=0,
        ),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        column = self.layout.column(align=True)
        for name in ("start", "end"):
            column.prop(self, name)
        column = self.layout.column()
        for name in ("focal", "rolling_shutter", "smooth_frames", "live"):
            column.prop(self, name)

    def make_job(self, context: bpy.types.Context) -> TrackJob:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        scene = context.scene
        splat_object.picked(scene, scene.gssmc.splat)
        start, end = plate_options.range_of(self, scene)
        camera_channels.check_writable(scene.camera)
        settings = settings_props.settings_from(scene.gssmc, self.properties)
        solve = settings.lens != "fixed"
        track = TrackSettings(settings.long_side_px, solve, self.rolling_shutter, self.smooth_frames, self.focal)
        before = track_result.earlier(scene, scene.camera, start, end)
        pinned = pins.poses(scene, scene.camera, scene.gssmc.splat, start, end)
        options = TrackOptions(start, end, track, self.asked and self.live, before, pinned)
        job = TrackJob(scene, scene.camera, options, settings)
        problem.begin(self.bl_label, job.reports)
        return job

    def apply(self, context: bpy.types.Context, job: TrackJob, result: Any) -> set[str]:
        message, trusted = track_result.write(job, result)
        return self.done(context, message, "INFO" if trusted else "WARNING")

    def stopped(self, context: bpy.types.Context, job: TrackJob) -> set[str]:
        track = job.kept()
        if track is None:
            return super().stopped(context, job)
        values = {"count": len(track.frames), "start": track.frames[0].frame, "end": track.frames[-1].frame}
        text = rpt_("The tracking was stopped. Frames that have a camera: {count}, from {start} to {end}.", **values)
        return self.apply(context, job, replace(track, reasons=(text, *track.reasons)))


classes = (GSSMC_OT_track_plate,)
