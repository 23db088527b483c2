"""Add Plate: a camera for an image sequence or a movie."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import bpy
from bpy.props import BoolProperty, IntProperty

from ..core.photos.plate import open_plate
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.plate import timeline
from ..gssmc_addon.support.texts import rpt_
from .add_photo import AddsPicture


class GSSMC_OT_add_plate(Idle, AddsPicture, bpy.types.Operator):
    """Load a movie or a numbered image sequence and set it behind a camera, its frames at their own numbers"""

    bl_idname = "gssmc.add_plate"
    bl_label = "Add Plate"
    bl_options = {"UNDO"}

    __annotations__ = {
        "filter_movie": BoolProperty(default=True, options={"HIDDEN"}),
        "set_resolution": BoolProperty(
            name="Set Resolution",
            default=True,
            description="Make the render resolution the plate's, so that it fills the camera's frame",
        ),
        "set_range": BoolProperty(
            name="Set Frame Range",
            default=True,
            description="Make the scene's range of frames, and of a movie its frame rate, the plate's, and go to its start",
        ),
        "first_frame": IntProperty(
            name="First Frame",
            default=timeline.OWN_NUMBER,
            min=timeline.OWN_NUMBER,
            description="The scene's frame that shows the plate's first one; -1: the number in the file's name, of a movie 1",
        ),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts move objects and expect their new places to be used.
        plate, first, last = open_plate(Path(bpy.path.abspath(self.filepath)))
        start = first if self.first_frame == timeline.OWN_NUMBER else self.first_frame
        photo = plate_source.frame_source(plate, first).read()
        load = partial(plate_source.load, plate.file(first), plate.is_movie)
        camera, loaded, notes = self.set_behind(context, photo, load)
        image = loaded.image
        plate_source.set_frames(camera.data, image, start, first, last)
        photo_camera.look_through(context, camera)
        if self.set_range:
            notes += timeline.fit(context.scene, plate, start, start + last - first)
        values = {"plate": image.name, "camera": camera.name, "start": start, "end": start + last - first}
        said = rpt_('"{plate}" is set behind "{camera}", frames {start} to {end}.', **values)
        return self.done(context, " ".join([said, *notes]))

    def camera_name(self) -> str:
        return plate_source.shot_name(Path(self.filepath))


classes = (GSSMC_OT_add_plate,)
