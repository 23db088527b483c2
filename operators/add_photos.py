"""Add Photos, Add Folder: many photographs, each with a camera of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ..core.errors import RefineError
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo.queue import SUFFIXES, AddPhotosJob, photos_in
from ..gssmc_addon.support.operator_parts import JobFromFile
from ..gssmc_addon.support.session_ids import by_uid
from ..gssmc_addon.support.texts import rpt_

FILTER = ";".join(f"*{suffix}" for suffix in SUFFIXES)


class _AddPhotos(JobFromFile):
    """What the two ways of choosing photos share."""

    __annotations__ = {
        "directory": StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"}),
        "files": CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"}),
        "filter_folder": BoolProperty(default=True, options={"HIDDEN"}),
        "filter_glob": StringProperty(default=FILTER, options={"HIDDEN"}),
        "camera_file": StringProperty(
            name="Camera File",
            subtype="FILE_PATH",
            description="Optional JSON file of cameras; those that name a photo give it lens, distortion and start pose",
        ),
    }

    def _chosen(self) -> list[Path]:
        """The files that were chosen, in the order of the list."""
        raise NotImplementedError

    def make_job(self, context: bpy.types.Context) -> AddPhotosJob:
        context.view_layer.update()
        known = photo_list.files(context.scene)
        paths = [path for path in map(Path.absolute, self._chosen()) if str(path) not in known]
        if not paths:
            raise RefineError(rpt_("All of these photos are on the list already."))
        return AddPhotosJob(context.scene, paths, self.camera_file)

    def apply(self, context: bpy.types.Context, job: AddPhotosJob, result: Any) -> set[str]:
        scene = context.scene
        if not job.added:
            name, message = job.failed[0] if job.failed else ("", rpt_("No photo was added."))
            return self.refuse(context, message)
        for name, message in job.failed:
            photo_list.add_unreadable(scene, name, message)
        photo_list.pick(scene, by_uid(scene.objects, job.added[0]))
        return self.done(context, _summary(job), "WARNING" if job.failed else "INFO")

    def broke_off(self, context: bpy.types.Context, job: AddPhotosJob, message: str) -> set[str]:
        """What was added before is kept; without this it would be in no undo step."""
        self.refuse(context, message)
        return {"FINISHED"} if job.added else {"CANCELLED"}

    def stopped(self, context: bpy.types.Context, job: AddPhotosJob) -> set[str]:
        if job.added:
            return self.apply(context, job, job)
        return self.refuse(context, rpt_("Adding photos was stopped; nothing was changed."), level="INFO")


def _summary(job: AddPhotosJob) -> str:
    """Up to three sentences: what was added, what could not be, what was left out."""
    sentences = [rpt_("{count} photos added, each with its camera.", count=len(job.added))]
    if len(job.added) == 1:
        sentences = [rpt_("1 photo added, with its camera.")]
    if job.failed:
        sentences.append(rpt_("{count} could not be used; the list says why.", count=len(job.failed)))
    left = job.count - len(job.added) - len(job.failed)
    if left == 1:
        sentences.append(rpt_("1 was left out when you stopped."))
    elif left:
        sentences.append(rpt_("{count} were left out when you stopped.", count=left))
    return " ".join(sentences)


class GSSMC_OT_add_photos(_AddPhotos, bpy.types.Operator):
    """Load photographs; each gets a camera of its own, at the current view or where a camera file says"""

    bl_idname = "gssmc.add_photos"
    bl_label = "Add Photos"
    bl_options = {"UNDO"}

    __annotations__ = {
        **_AddPhotos.__annotations__,
    }

    def _chosen(self) -> list[Path]:
        names = [file.name for file in self.files if file.name]
        if not names and not self.directory and self.filepath:
            return [Path(bpy.path.abspath(self.filepath))]
        folder = Path(bpy.path.abspath(self.directory))
        return [folder / name for name in names] if names else photos_in(folder)


class GSSMC_OT_add_photo_folder(_AddPhotos, bpy.types.Operator):
    """Load all photographs of the folder that the file browser shows, whichever is picked; each gets a camera of its own"""

    bl_idname = "gssmc.add_photo_folder"
    bl_label = "Add Folder"
    bl_options = {"UNDO"}

    __annotations__ = {**_AddPhotos.__annotations__}

    def _chosen(self) -> list[Path]:
        """The browser lists the photos, so that one sees what comes; scripts may name the folder, or a photo in it."""
        if not self.directory and self.filepath:
            path = Path(bpy.path.abspath(self.filepath))
            return photos_in(path if path.is_dir() else path.parent)
        return photos_in(Path(bpy.path.abspath(self.directory)))


classes = (GSSMC_OT_add_photos, GSSMC_OT_add_photo_folder)
