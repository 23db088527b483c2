"""What Refine Plate asks for, and what it needs before it can begin."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ...core.errors import RefineError
from ..photo import image as photo_image
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
    camera = _camera_of(scene)
    plate = plate_source.moving_photo(camera)
    if plate is None:
        raise RefineError(plate_source.no_plate(camera))
    first, last = plate.scene_range
    low, high = max(first, scene.frame_start), min(last, scene.frame_end)
    return (low, high) if low <= high else (first, last)


def options_of(operator: bpy.types.Operator, scene: bpy.types.Scene) -> SequenceOptions:
    """The operator's options, with the frames that scene and plate share where none were set. Raises RefineError."""
    start, end = range_of(operator, scene)
    return SequenceOptions(
        start, end, operator.step, operator.smooth_frames, operator.every_frame, operator.key_lens, operator.find_start
    )


def range_of(operator: bpy.types.Operator, scene: bpy.types.Scene) -> tuple[int, int]:
    """The operator's first and last frame; those that scene and plate share where none were set. Raises RefineError."""
    low, high = shared_range(scene)
    start = operator.start if operator.properties.is_property_set("start") else low
    end = operator.end if operator.properties.is_property_set("end") else high
    return start, end


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
        camera = _camera_of(scene)
    except RefineError as error:
        return str(error)
    image, slots = photo_image.camera_photo(camera), camera.data.background_images
    clip = image is None and any(slot.source == "MOVIE_CLIP" and slot.clip for slot in slots)
    moves = clip or (image is not None and image.source in plate_source.MOVING)
    return "" if moves else plate_source.no_plate(camera)
