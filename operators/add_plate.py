"""Add Plate: a camera for an image sequence or a movie."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import bpy
from bpy.props import BoolProperty

from ..core.photos.plate import open_plate
from ..gssmc_addon.jobs.operator import Idle
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.plate import source as plate_source
from ..gssmc_addon.support.texts import rpt_
from .add_photo import AddsPicture


class GSSMC_OT_add_plate(Idle, AddsPicture, bpy.types.Operator):
    """Load a movie or a numbered image sequence and set it behind a camera, from the current frame on"""

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
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts move objects and expect their new places to be used.
        start = context.scene.frame_current
        plate, first, last = open_plate(Path(bpy.path.abspath(self.filepath)))
        photo = plate_source.frame_source(plate, first).read()
        load = partial(plate_source.load, plate.file(first), plate.is_movie)
        camera, loaded, _ = self.set_behind(context, photo, load)
        image = loaded.image
        plate_source.set_frames(camera.data, image, start, first, last)
        photo_camera.look_through(context, camera)
        values = {"plate": image.name, "camera": camera.name, "start": start, "end": start + last - first}
        return self.done(context, rpt_('"{plate}" is set behind "{camera}", frames {start} to {end}.', **values))


classes = (GSSMC_OT_add_plate,)
