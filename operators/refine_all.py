"""Refine All: the photos of the list, one after the other."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..gssmc_addon.jobs.operator import JobOperator
from ..gssmc_addon.photo import list as photo_list
from ..gssmc_addon.photo import queue as photo_queue
from ..gssmc_addon.photo import same_lens
from ..gssmc_addon.registration import settings as settings_props
from ..gssmc_addon.support import problem
from ..gssmc_addon.support.operator_parts import NeedsPhoto
from ..gssmc_addon.support.texts import rpt_, tip_


class OfList(NeedsPhoto, JobOperator):
    """What Refine All and Find All share."""

    find = False

    __annotations__ = {
        "which": EnumProperty(name="Which", items=photo_queue.WHICH, default="ALL", description="Which photos are refined"),
        "again": BoolProperty(
            name="Try Again",
            default=True,
            description="Photos of which no camera was found are tried again: from the cameras of solved photos, up to four, "
            "and in the whole scan",
        ),
        "same_lens": BoolProperty(
            name="Same Lens",
            default=True,
            description="At the end, photos of one camera share its lens (see Same Lens)",
        ),
        **settings_props.settings_annotations(),
        **settings_props.model_annotations(),
    }

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        which = next(item[2] for item in photo_queue.WHICH if item[0] == properties.which)
        return f"{tip_(cls.__doc__ or '')}. {tip_(which)}"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return photo_list.poll(cls, context.scene) and super().poll(context)

    def make_job(self, context: bpy.types.Context) -> photo_queue.RefineQueue:
        context.view_layer.update()  # Scripts set locations and expect them to be used.
        scene = context.scene
        settings = settings_props.settings_from(scene.gssmc, self.properties)
        job = photo_queue.queue(scene, self.which, settings, photo_queue.QueueOptions(self.find, self.again))
        problem.begin(self.bl_label)
        return job

    def apply(self, context: bpy.types.Context, job: photo_queue.RefineQueue, result: Any) -> set[str]:
        message = " ".join([job.summary(), *self._shared(job)])
        self.tell(context, message, "ERROR" if job.failed else "INFO")
        clean = job.verdicts["trusted"] == job.items
        self.report({"INFO" if clean else "WARNING"}, message)
        return {"FINISHED" if job.refined else "CANCELLED"}

    def _shared(self, job: photo_queue.RefineQueue) -> list[str]:
        """Sentences on the lenses that photos now share."""
        return list(same_lens.share(job.scene).sentences) if self.same_lens and job.refined else []

    def stopped(self, context: bpy.types.Context, job: photo_queue.RefineQueue) -> set[str]:
        """What was refined before the stop is kept: each photo stands for itself."""
        message = rpt_("Stopped. {summary}", summary=job.summary())
        self.tell(context, message)
        self.report({"INFO"}, message)
        return {"FINISHED" if job.refined else "CANCELLED"}

    def broke_off(self, context: bpy.types.Context, job: photo_queue.RefineQueue, message: str) -> set[str]:
        """Keeps what was refined before; without this it would be in no undo step."""
        self.refuse(context, message)
        return {"FINISHED" if job.refined else "CANCELLED"}


class GSSMC_OT_refine_all(OfList, bpy.types.Operator):
    """Find the exact cameras of the list's photos, one after the other, each from where its camera stands"""

    bl_idname = "gssmc.refine_all"
    bl_label = "Refine All"
    bl_options = {"UNDO"}

    __annotations__ = OfList.__annotations__


class GSSMC_OT_find_all(OfList, bpy.types.Operator):
    """Find the exact cameras of the list's photos, one after the other, wherever the cameras stand now. Solved photos help to
    find the others"""

    bl_idname = "gssmc.find_all"
    bl_label = "Find All"
    bl_options = {"UNDO"}

    __annotations__ = OfList.__annotations__
    find = True


classes = (GSSMC_OT_refine_all, GSSMC_OT_find_all)
