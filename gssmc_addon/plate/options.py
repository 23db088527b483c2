"""What Refine Plate asks for, and what it needs before it can begin."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ...core.errors import GssmcError, RefineError
from ..jobs.operator import OperatorMixin
from ..splat import object as splat_object
from ..support.texts import rpt_
from . import source as plate_source


@dataclass(frozen=True)
class SequenceOptions:
    """Frames of the scene from `start` to `end` by `step`; `smooth_frames`: shorter wiggles are taken out; `find_start`: where
    the first frame fails from where the camera stands, it is found in the whole scan.
    """

    start: int
    end: int
    step: int
    smooth_frames: float
    every_frame: bool
    key_lens: bool
    find_start: bool = True


def range_annotations() -> dict[str, object]:
    """The first and the last frame as Blender properties."""
    return {
        "start": IntProperty(
            name="Start", description="First frame of the scene; by default the first that plate and scene share"
        ),
        "end": IntProperty(name="End", description="Last frame of the scene; by default the last that plate and scene share"),
    }


def plate_annotations() -> dict[str, object]:
    """The options of the dialog as Blender properties."""
    return {
        **range_annotations(),
        "step": IntProperty(name="Step", description="The number of frames from one keyframe to the next", default=10, min=1),
        "smooth_frames": FloatProperty(
            name="Smooth (frames)",
            description="Removes shaking of the path that is shorter than this many frames; 0: none",
            default=20,
            min=0,
        ),
        "every_frame": BoolProperty(
            name="Key Every Frame",
            description="Also key the frames in between, on a smooth path. Off, Blender's curves do, which ease in and out",
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
            description="Also key focal length and shift, for a zoom. Off, the lens stays as it is",
            default=False,
        ),
    }


def shared_range(scene: bpy.types.Scene) -> tuple[int, int]:
    """The frames that scene and plate share. Raises RefineError."""
    first, last = _plate_of(scene).scene_range
    low, high = max(first, scene.frame_start), min(last, scene.frame_end)
    return (low, high) if low <= high else (first, last)


def options_of(operator: bpy.types.Operator, scene: bpy.types.Scene) -> SequenceOptions:
    """The operator's options, with the frames that scene and plate share where none were set. Raises RefineError."""
    start, end = range_of(operator, scene)
    return SequenceOptions(
        start, end, operator.step, operator.smooth_frames, operator.every_frame, operator.key_lens, operator.find_start
    )


def range_of(operator: bpy.types.Operator, scene: bpy.types.Scene) -> tuple[int, int]:
    """The operator's first and last frame; those that scene and plate share where none were set. Raises RefineError where
    they are no range of the plate's frames.
    """
    low, high = shared_range(scene)
    start = operator.start if operator.properties.is_property_set("start") else low
    end = operator.end if operator.properties.is_property_set("end") else high
    if start > end:
        raise RefineError(rpt_("The range ends at frame {end}, before its start {start}; exchange them.", start=start, end=end))
    first, last = _plate_of(scene).reach
    if not first <= start <= end <= last:
        values = {"start": start, "end": end, "first": first, "last": last}
        raise RefineError(
            rpt_(
                "The plate covers the frames {first} to {last} of the scene, not {start} to {end}; choose among them.",
                **values,
            )
        )
    return start, end


class OfPlate(OperatorMixin):
    """A mixin for operators on the scene camera's plate: their button is grey where something is missing, and says what."""

    needs_splat = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacks = lack(context.scene) if cls.needs_splat else lack_of_plate(context.scene)
        if lacks:
            cls.poll_message_set(lacks)
            return False
        return super().poll(context)


class AsksForRange(OfPlate):
    """A mixin for jobs on a range of the plate's frames, which a dialog asks for."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            self.asked, shared = True, shared_range(context.scene)
        except GssmcError as error:
            return self.refuse(context, str(error))
        for name, frame in zip(("start", "end"), shared, strict=True):
            if not self.properties.is_property_set(name):
                setattr(self, name, frame)
        return context.window_manager.invoke_props_dialog(self, confirm_text=self.bl_label)


def _plate_of(scene: bpy.types.Scene) -> plate_source.MovingPhoto:
    """The plate of the scene's camera. Raises RefineError where there is none."""
    camera = _camera_of(scene)
    plate = plate_source.moving_photo(camera)
    if plate is None:
        raise RefineError(plate_source.no_plate(camera))
    return plate


def _camera_of(scene: bpy.types.Scene) -> bpy.types.Object:
    """The scene's camera. Raises RefineError when there is none."""
    camera: bpy.types.Object | None = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise RefineError(rpt_("The scene has no camera for the plate; use Add Plate in the GS-SMC panel."))
    return camera


def lack(scene: bpy.types.Scene) -> str:
    """Why no plate can be refined, as a sentence, without opening its file; "" when one can."""
    try:
        splat_object.picked(scene, scene.gssmc.splat)
    except RefineError as error:
        return str(error)
    return lack_of_plate(scene)


def lack_of_plate(scene: bpy.types.Scene) -> str:
    """Why there is no plate, as a sentence, without opening its file; "" when there is one."""
    try:
        camera = _camera_of(scene)
    except RefineError as error:
        return str(error)
    return "" if plate_source.moves(camera) else plate_source.no_plate(camera)
