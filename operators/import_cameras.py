"""File > Import > Photo Cameras: start cameras from COLMAP, nerfstudio or JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from ..gssmc_addon.camera import bridge as camera_bridge
from ..gssmc_addon.camera.import_job import CameraImport
from ..gssmc_addon.support.operator_parts import JobFromFile
from ..gssmc_addon.support.texts import rpt_


class GSSMC_OT_import_cameras(JobFromFile, bpy.types.Operator):
    """Import cameras, with their photos, from a file of COLMAP, nerfstudio, Metashape and others, in the splat's own world"""

    bl_idname = "gssmc.import_cameras"
    bl_label = "Import Cameras"
    bl_options = {"UNDO"}

    __annotations__ = {
        "filter_glob": StringProperty(
            default="*.json;*.txt;*.bin;*.xml;*.csv;*.sfm;*.out;*.nvm;*.xmp;*.r3d;*.fspy;*.abc", options={"HIDDEN"}
        ),
        "photos": StringProperty(
            name="Photos",
            subtype="DIR_PATH",
            description="Folder of the photos; empty: beside the file, or in a folder named images near it",
        ),
        "world": StringProperty(
            name="Training World",
            subtype="FILE_PATH",
            description="For cameras of transforms.json and a splat that nerfstudio exported: the dataparser_transforms.json "
            "of the training's output folder, which says how the splat was moved",
        ),
        "set_resolution": BoolProperty(
            name="Set Resolution", default=False, description="Make the render resolution that of the first camera's photo"
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.gssmc.splat is None:
            cls.poll_message_set("Cameras need a splat to stand in; import the splat first")
            return False
        return super().poll(context)

    def make_job(self, context: bpy.types.Context) -> CameraImport:
        context.view_layer.update()
        camera_bridge.splat_similarity(context.scene.gssmc.splat)
        path, photos, world = (Path(bpy.path.abspath(p)) if p else None for p in (self.filepath, self.photos, self.world))
        return CameraImport(context.scene, path or Path(), photos, self.set_resolution, world)

    def apply(self, context: bpy.types.Context, job: CameraImport, result: Any) -> set[str]:
        job.finish()
        values = {"count": job.made, "file": Path(self.filepath).name, "shown": job.shown}
        sentences = [rpt_('{count} cameras from "{file}", {shown} of them with their photo.', **values)]
        if job.made == 1:
            photo = rpt_('1 camera from "{file}", with its photo.', file=values["file"])
            sentences = [photo if job.shown else rpt_('1 camera from "{file}", without its photo.', file=values["file"])]
        if job.left_out == 1:
            sentences.append(rpt_("1 without a lens was left out."))
        elif job.left_out:
            sentences.append(rpt_("{count} without a lens were left out.", count=job.left_out))
        if job.unfit:
            sentences.append(rpt_("{count} do not fit their photos and were left out:", count=len(job.unfit)))
            sentences.append(job.unfit[0])
        sentences += job.notes
        return self.done(context, " ".join(sentences), "WARNING" if job.unfit or job.notes else "INFO")

    def stopped(self, context: bpy.types.Context, job: CameraImport) -> set[str]:
        return self.refuse(context, rpt_("The import was cancelled; nothing was changed."), level="INFO")


classes = (GSSMC_OT_import_cameras,)
