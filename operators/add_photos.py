"""Add Photos: many photographs, each with a camera of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ..core.errors import RefineError
from ..gssmc_addon.photo import adding
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.support.operator_parts import JobFromFile
from ..gssmc_addon.support.session_ids import by_uid
from ..gssmc_addon.support.texts import rpt_


class AddsPhotos(JobFromFile):
    """What the two ways of choosing photos share."""

    __annotations__ = {
        "directory": StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"}),
        "files": CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"}),
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
        "filter_glob": StringProperty(default=adding.FILTER, options={"HIDDEN"}),
        "camera_file": StringProperty(
            name="Camera File",
            subtype="FILE_PATH",
            description="Optional file of cameras (JSON, COLMAP, nerfstudio, Metashape and others); those that name a photo "
            "give it lens, distortion and start pose",
        ),
    }

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Files that were dropped on the viewport are known already; else the file browser asks for them."""
        if self.files and self.directory:
            self.asked = True
            return self.execute(context)
        return super().invoke(context, event)

    def _chosen(self) -> list[Path]:
        """The files that were chosen, in the order of the list."""
        raise NotImplementedError

    def make_job(self, context: bpy.types.Context) -> adding.AddPhotosJob:
        context.view_layer.update()
        known = photo_list.files(context.scene)
        chosen = [path.absolute() for path in self._chosen()]
        paths = [path for path in chosen if str(path) not in known]
        if not paths:
            raise RefineError(rpt_("All of these photos are on the list already."))
        job = adding.AddPhotosJob(context.scene, paths, self.camera_file)
        job.known, job.others, job.raws = len(chosen) - len(paths), self._others(), self._raws()
        return job

    def _others(self) -> list[str]:
        """Names of files that were left out because they are no photos."""
        return []

    def _raws(self) -> int:
        """How many raw photos were left out because they are chosen as pictures too."""
        return 0

    def apply(self, context: bpy.types.Context, job: adding.AddPhotosJob, result: Any) -> set[str]:
        scene = context.scene
        if not job.added:
            return self.refuse(context, job.failed[0][1] if job.failed else rpt_("No photo was added."))
        for name, message in job.failed:
            photo_list.add_unreadable(scene, name, message)
        photo_list.pick(scene, by_uid(scene.objects, job.added[0]))
        return self.done(context, job.summary(), "WARNING" if job.failed or job.others else "INFO")

    def broke_off(self, context: bpy.types.Context, job: adding.AddPhotosJob, message: str) -> set[str]:
        """Keeps what was added before; without this it would be in no undo step."""
        self.refuse(context, message)
        return {"FINISHED"} if job.added else {"CANCELLED"}

    def stopped(self, context: bpy.types.Context, job: adding.AddPhotosJob) -> set[str]:
        if job.added:
            return self.apply(context, job, job)
        return self.refuse(context, rpt_("Adding photos was stopped; nothing was changed."), level="INFO")


class GSSMC_OT_add_photos(AddsPhotos, bpy.types.Operator):
    """Load photographs; each gets a camera of its own, at the current view or where a camera file says"""

    bl_idname = "gssmc.add_photos"
    bl_label = "Add Photos"
    bl_options = {"UNDO"}

    __annotations__ = {**AddsPhotos.__annotations__}

    def _chosen(self) -> list[Path]:
        return adding.chosen_photos(self.directory, [file.name for file in self.files if file.name], self.filepath)


classes = (GSSMC_OT_add_photos,)
