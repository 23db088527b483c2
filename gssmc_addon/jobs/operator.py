"""What every operator with a job shares: blocking in scripts and background mode, beside Blender in the window."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.errors import GssmcError
from ..refine import job as jobs
from ..support.texts import rpt_
from .machine import Job


class Idle:
    """A mixin for operators that stand back while a job runs."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if jobs.active():
            cls.poll_message_set("A refinement or another job is running; wait for it or cancel it")
            return False
        return True


class Reporter:
    """A mixin: what an operator has to say, in Blender's report and in the panel's line."""

    def done(self, context: bpy.types.Context, message: str, level: str = "INFO", line: str = "") -> set[str]:
        """The result of success. The panel's line becomes `line`: what stood there, be it the error resolved, is past."""
        self.tell(context, line)
        self.report({level}, message)
        return {"FINISHED"}

    def tell(self, context: bpy.types.Context, message: str, icon: str = "INFO") -> None:
        """The line in the panel."""
        context.window_manager.gssmc.tell(message, icon)


class JobOperator(Idle, Reporter):
    """A mixin. The operator says what to do in `gather` and what to make of the result in `apply`."""

    def gather(self, context: bpy.types.Context) -> Job:
        """The job, with all its inputs copied out of Blender. Raises GssmcError."""
        raise NotImplementedError

    def apply(self, context: bpy.types.Context, job: Job, result: Any) -> set[str]:
        """Writes the result, reports, and gives the operator's own result. Raises GssmcError, with nothing written."""
        raise NotImplementedError

    def stopped(self, context: bpy.types.Context, job: Job) -> set[str]:
        """The operator's result when the user stopped the job."""
        return self.refuse(context, rpt_("The work was cancelled; nothing was changed."), level="INFO")

    def broke_off(self, context: bpy.types.Context, job: Job, message: str) -> set[str]:
        """The operator's result when the job could not go on."""
        return self.refuse(context, message)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Blocking; the way of scripts and background mode."""
        try:
            job = self.gather(context)
        except GssmcError as error:
            return self.refuse(context, str(error))
        try:
            return self.apply(context, job, job.run())
        except GssmcError as error:
            return self.broke_off(context, job, str(error))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.begin(context)

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Starts the job beside Blender."""
        try:
            job = self.gather(context)
        except GssmcError as error:
            return self.refuse(context, str(error))
        self.tell(context, "")
        jobs.begin(context, job)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = jobs.active()
        if job is None:  # ended from outside: another file was opened
            return {"CANCELLED"}
        if event.type == "ESC" or job.cancelled:
            job.cancel()
            jobs.end(job)
            return self.stopped(context, job)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            result = job.tick()
            if result is None:
                return {"PASS_THROUGH"}
            jobs.end(job)
            return self.apply(context, job, result)
        except GssmcError as error:
            jobs.end(job)
            return self.broke_off(context, job, str(error))

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: the window closes, or another file is opened."""
        job = jobs.active()
        if job:
            job.cancel()
            jobs.end(job)

    def refuse(self, context: bpy.types.Context, message: str, level: str = "ERROR") -> set[str]:
        self.tell(context, message, level)
        self.report({level}, message)
        return {"CANCELLED"}


class AskingJobOperator(JobOperator):
    """A mixin for jobs that a dialog or the file browser comes before: `invoke` sets `asked`, and Blender calls `execute`."""

    asked = False

    def execute(self, context: bpy.types.Context) -> set[str]:
        """After the dialog beside Blender; from scripts it waits."""
        return self.begin(context) if self.asked else super().execute(context)
