"""Refine Plate: the camera of a moving plate, as keyframes."""

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ..core.errors import GssmcError, RefineError
from ..gssmc_addon.camera import channels as camera_channels
from ..gssmc_addon.camera import keys as camera_keys
from ..gssmc_addon.camera import solution as camera_solution
from ..gssmc_addon.camera.record import Solution
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.plate.job import SequenceJob, SequenceOptions, frame_list
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.splat import object as splat_object
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_refine_sequence(AskingJobOperator, bpy.types.Operator):
    """Find the camera of a movie or image sequence every few frames, each from its neighbour's answer"""

    bl_idname = "gssmc.refine_sequence"
    bl_label = "Refine Plate"
    bl_options = {"UNDO"}

    __annotations__ = {
        "start": IntProperty(name="Start", description="First frame of the scene; by default of plate and scene together"),
        "end": IntProperty(name="End", description="Last frame of the scene; by default of plate and scene together"),
        "step": IntProperty(name="Step", description="A keyframe every so many frames", default=10, min=1),
        "smooth_frames": FloatProperty(
            name="Smooth (frames)",
            description="Wiggles shorter than this many frames are taken out; 0 = none",
            default=20,
            min=0,
        ),
        "every_frame": BoolProperty(
            name="Key Every Frame",
            description="Key the frames between too, on a smooth path; else Blender's curves do, which ease in and out",
            default=True,
        ),
        "find_start": BoolProperty(
            name="Find the First Frame",
            description="Where no camera is found at the current frame from where the camera stands, look for it in the whole "
            "scan, as Find Camera does",
            default=True,
        ),
        "key_lens": BoolProperty(
            name="Key the Lens",
            description="Also key focal length and shift, for a zoom; else the lens stays as it is",
            default=False,
        ),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    @classmethod
    def poll(cls, context):
        lack = _lack(context.scene)
        if lack:
            cls.poll_message_set(lack)
            return False
        return super().poll(context)

    def invoke(self, context, event):
        try:
            self.asked, (low, high) = True, self._range(context)
        except GssmcError as error:
            return self.refuse(context, str(error))
        if not self.properties.is_property_set("start"):
            self.start = low
        if not self.properties.is_property_set("end"):
            self.end = high
        return context.window_manager.invoke_props_dialog(self, confirm_text="Refine Plate")

    def draw(self, context):
        self.layout.use_property_split = True
        column = self.layout.column(align=True)
        for name in ("start", "end", "step"):
            column.prop(self, name)
        column = self.layout.column()
        for name in ("smooth_frames", "every_frame", "find_start", "key_lens"):
            column.prop(self, name)

    def gather(self, context):
        context.view_layer.update()  # scripts set locations and expect them to count
        scene = context.scene
        splat_object.check_picked(scene, scene.gssmc.splat)
        low, high = self._range(context)
        start, end = (
            getattr(self, name) if self.properties.is_property_set(name) else default
            for name, default in (("start", low), ("end", high))
        )
        camera_channels.check_writable(scene.camera)
        options = SequenceOptions(start, end, self.step, self.smooth_frames, self.every_frame, self.key_lens, self.find_start)
        settings = settings_props.settings_from(scene.gssmc, self.properties, **({} if self.key_lens else {"lens": "fixed"}))
        job = SequenceJob(scene, scene.camera, options, settings)
        problem.begin(self.bl_label, job.reports)
        return job

    def apply(self, context, job, result):
        scene, splat, camera = job.find()
        cameras = job.path()
        camera_keys.write(scene, camera, splat, cameras, job.options.key_lens)
        seconds = sum(report.seconds for report in job.reports.values())
        trusted = not job.bad and not job.doubtful
        solved = job.options.key_lens and job.settings.lens != "fixed"
        state = "SOLVED" if solved else camera.data.gssmc.lens_state
        first, verdict = cameras[min(cameras)], "trusted" if trusted else "check"
        found = Solution(first, verdict, tuple(job.reasons()), 0, seconds, state, job.median_depth, path=cameras)
        camera_solution.keep(scene, camera, splat, found)
        camera.data.gssmc.frames_done, camera.data.gssmc.bad_frames = job.items, frame_list(job.bad)
        values = {"name": camera.name, "summary": job.summary(), "count": len(cameras)}
        message = rpt_('"{name}": {summary} {count} keys were set.', **values)
        if len(cameras) == 1:
            message = rpt_('"{name}": {summary} 1 key was set.', **values)
        return self.done(context, message, "INFO" if trusted else "WARNING")

    def _range(self, context):
        """The frames that scene and plate share. Raises RefineError."""
        scene, camera = context.scene, context.scene.camera
        _check_camera(camera)
        plate = plate_source.moving_photo(camera)
        if plate is None:
            raise RefineError(plate_source.no_plate(camera))
        first, last = plate.scene_range
        low, high = max(first, scene.frame_start), min(last, scene.frame_end)
        return (low, high) if low <= high else (first, last)


def _check_camera(camera):
    if camera is None or camera.type != "CAMERA":
        raise RefineError(rpt_("The scene has no camera for the plate; use Add Plate in the GS-SMC panel."))


def _lack(scene):
    """Why no plate can be refined, as a sentence, without opening its file; "" when one can."""
    try:
        splat_object.check_picked(scene, scene.gssmc.splat)
        _check_camera(scene.camera)
    except RefineError as error:
        return str(error)
    image, slots = photo_image.camera_photo(scene.camera), scene.camera.data.background_images
    clip = image is None and any(slot.source == "MOVIE_CLIP" and slot.clip for slot in slots)
    moves = clip or (image is not None and image.source in plate_source.MOVING)
    return "" if moves else plate_source.no_plate(scene.camera)


classes = (GSSMC_OT_refine_sequence,)
