"""Add Photo: a camera for a photograph, with the photo behind it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..core.photos.photo import Photo
from ..gssmc_addon.photo import camera as photo_camera
from ..gssmc_addon.photo import image as photo_image
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.support.operator_parts import FromFile, PlainOperator
from ..gssmc_addon.support.texts import rpt_


class AddsPicture(PlainOperator, FromFile):
    """What Add Photo and Add Plate share: the options, and how a picture gets its camera."""

    __annotations__ = {
        "filter_image": BoolProperty(default=True, options={"HIDDEN"}),
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
        "camera": EnumProperty(
            name="Camera",
            items=photo_camera.CAMERA_ITEMS,
            default="AUTO",
            description="The camera that the picture is set behind",
        ),
        "camera_file": StringProperty(
            name="Camera File",
            subtype="FILE_PATH",
            description="Optional file of cameras (JSON, COLMAP, nerfstudio, Metashape and others); the one that names the "
            "chosen file gives lens, distortion and start pose",
        ),
    }

    def set_behind(
        self, context: bpy.types.Context, photo: Photo, load: Callable[[], bpy.types.Image], may_cut: bool = False
    ) -> tuple[bpy.types.Object, photo_camera.LoadedPhoto, list[str]]:
        """Camera, what was set behind it and what to say of them; `load` makes the image once the camera file is known to fit.

        `may_cut`: a photo of a wide lens is cut. Raises GssmcError, with nothing changed.
        """
        given = photo_camera.find_camera(context.scene, self.camera_file, photo, may_cut) if self.camera_file else None
        used, given = photo_camera.cut_photo(photo, given)
        image = load() if used is photo else photo_image.load_cut(self.filepath, used)
        camera = photo_camera.choose_camera(context, self.camera, self.camera_name(), used)
        loaded = photo_camera.LoadedPhoto(used, image, given)
        return camera, loaded, photo_camera.fit_camera(context, camera, loaded, self.set_resolution)

    def camera_name(self) -> str:
        """What a new camera is called after; its suffix goes."""
        return Path(self.filepath).name


class GSSMC_OT_add_photo(AddsPicture, bpy.types.Operator):
    """Load a photograph and set it behind a camera, ready to be refined"""

    bl_idname = "gssmc.add_photo"
    bl_label = "Add Photo"
    bl_options = {"UNDO"}

    __annotations__ = {
        "set_resolution": BoolProperty(
            name="Set Resolution",
            default=False,
            description="Make the render resolution the photo's, so that it fills the camera's frame. Without, the photo lies "
            "in the middle of the frame as large as fits",
        ),
    }

    def run(self, context: bpy.types.Context) -> set[str]:
        context.view_layer.update()  # Scripts move objects and expect their new places to be used.
        photo = photo_image.read_any_photo(self.filepath)
        load = partial(photo_image.load_image, self.filepath, photo)
        camera, loaded, notes = self.set_behind(context, photo, load, may_cut=True)
        photo, image = loaded.photo, loaded.image
        photo_list.add(context.scene, camera, photo)
        photo_list.pick(context.scene, camera)  # and look through it
        values = {"photo": image.name, "camera": camera.name, "x": photo.width, "y": photo.height}
        return self.done(context, " ".join([rpt_('"{photo}" ({x} x {y}) is set behind "{camera}".', **values), *notes]))


classes = (GSSMC_OT_add_photo,)
