"""Undistort Plate: an image sequence for the background that agrees with Blender's cameras, which have no lens distortion."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ..core.errors import GssmcError
from ..gssmc_addon.jobs.operator import AskingJobOperator
from ..gssmc_addon.plate import undistort_job
from ..gssmc_addon.plate.options import OfPlate
from ..gssmc_addon.plate.undistort_job import UndistortJob
from ..gssmc_addon.support.session_ids import by_uid
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_undistort_plate(OfPlate, AskingJobOperator, bpy.types.Operator):
    """Write the plate's frames without their lens distortion, with 8 bits, and show them behind the camera; the plate itself \
stays what is tracked"""

    bl_idname = "gssmc.undistort_plate"
    bl_label = "Undistort Plate"
    bl_options = {"UNDO"}
    needs_splat = False

    __annotations__ = {
        "folder": StringProperty(
            name="Folder", subtype="DIR_PATH", description="Where the frames are written; empty: a new folder beside the plate"
        ),
    }

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.asked = True
        try:
            if not self.properties.is_property_set("folder"):
                self.properties.folder = str(undistort_job.default_folder(context.scene.camera))
        except GssmcError as error:
            return self.refuse(context, str(error))
        return context.window_manager.invoke_props_dialog(self, width=500, confirm_text="Undistort")

    def make_job(self, context: bpy.types.Context) -> UndistortJob:
        camera = context.scene.camera
        folder = Path(bpy.path.abspath(self.folder)) if self.folder else undistort_job.default_folder(camera)
        return UndistortJob(context.scene, camera, folder)

    def apply(self, context: bpy.types.Context, job: UndistortJob, result: Path) -> set[str]:
        camera = by_uid(bpy.data.objects, job.camera)
        assert camera is not None, "the job ends where its camera is gone"
        image = undistort_job.show(camera, job.plate, result)
        values = {"count": len(job.frames), "folder": result.parent, "plate": image.name, "camera": camera.name}
        said = rpt_('{count} frames were written to \'{folder}\'; "{plate}" is set behind "{camera}".', **values)
        if len(job.frames) == 1:
            said = rpt_('1 frame was written to \'{folder}\'; "{plate}" is set behind "{camera}".', **values)
        return self.done(context, said)


classes = (GSSMC_OT_undistort_plate,)
