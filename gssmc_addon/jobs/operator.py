"""What every operator with a job shares: blocking in scripts and background mode, beside Blender in the window."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy

from ...core.errors import GssmcError
from ..support.texts import rpt_, sentence
from . import slot
from .machine import Job, panel_is_open

log = logging.getLogger(__name__)

if TYPE_CHECKING:
    OperatorMixin = bpy.types.Operator
else:
    OperatorMixin = object  # Blender wants its own class once only, in the operator itself


class Idle(OperatorMixin):
    """A mixin for operators that cannot be called while a job runs."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if slot.active():
            cls.poll_message_set("A refinement or another job is running; wait for it or cancel it")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """The operator's own work. After a file browser Blender does not poll again, and a job may have begun meanwhile."""
        try:
            slot.check_free()
        except slot.BusyError as error:
            return self.busy(error)
        return super().execute(context)

    def busy(self, error: slot.BusyError) -> set[str]:
        """The operator's result while another job runs. The panel's line is not touched, because it belongs to that job."""
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


class Reporter(OperatorMixin):
    """A mixin that shows an operator's message in Blender's report and in the panel."""

    def done(self, context: bpy.types.Context, message: str, level: str = "INFO", line: str = "") -> set[str]:
        """The result of success. The panel's line becomes `line`, which also removes an earlier error."""
        self.tell(context, line)
        self.report({level}, message)
        return {"FINISHED"}

    def tell(self, context: bpy.types.Context, message: str, icon: str = "INFO") -> None:
        """Sets the line in the panel."""
        context.window_manager.gssmc.tell(message, icon)


class JobOperator(Idle, Reporter):
    """A mixin. The operator says which job it runs in `make_job` and what becomes of the result in `apply`.

    It owns the job that it made: it follows, stops and ends no other, whichever runs.
    """

    _job: Job | None = None  # Set while the job runs.
    _beside = False  # Whether the job runs beside Blender instead of blocking it.

    def make_job(self, context: bpy.types.Context) -> Job:
        """The job, with all its inputs copied out of Blender. Raises GssmcError."""
        raise NotImplementedError

    def apply(self, context: bpy.types.Context, job: Any, result: Any) -> set[str]:
        """Writes the result, reports, and gives the operator's own result. Raises GssmcError, with nothing written."""
        raise NotImplementedError

    def stopped(self, context: bpy.types.Context, job: Any) -> set[str]:
        """The operator's result when the user stopped the job."""
        return self.refuse(context, rpt_("The work was cancelled; nothing was changed."), level="INFO")

    def broke_off(self, context: bpy.types.Context, job: Any, message: str) -> set[str]:
        """The operator's result when the job could not go on."""
        return self.refuse(context, message)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Runs the job and blocks, as scripts and background mode need it."""
        return self._ending(context, partial(self._run, context))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.begin(context)

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Starts the job beside Blender."""
        self._beside = True
        return self._ending(context, partial(self._start, context))

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if job is None or job is not slot.active():  # The job was ended from outside, because another file was opened.
            self._job = None
            return {"CANCELLED"}
        # Only the press counts: the release may belong to the Esc that closed a dialog.
        if (event.type, event.value) == ("ESC", "PRESS") or job.cancelled:
            return self._ending(context, partial(self._stop, context, job))
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        return self._ending(context, partial(self._tick, context, job))

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: its dialog or window is closed, or another file is opened. There may be no job yet."""
        job, self._job = self._job, None
        if job:
            slot.stop(job)

    def refuse(self, context: bpy.types.Context, message: str, level: str = "ERROR") -> set[str]:
        """Reports a refusal once: in the panel if it is visible, otherwise in Blender's report."""
        self.tell(context, message, level)
        if not (self._beside and panel_is_open(context)):
            self.report({level}, message)
        return {"CANCELLED"}

    def _run(self, context: bpy.types.Context) -> set[str]:
        slot.check_free()
        job = self._job = self.make_job(context)
        return self.apply(context, job, job.run())

    def _start(self, context: bpy.types.Context) -> set[str]:
        slot.check_free()
        job = self._job = self.make_job(context)
        self.tell(context, "")
        slot.begin(context, job)
        window = slot.home(context)
        if window == context.window:
            context.window_manager.modal_handler_add(self)
        else:
            with context.temp_override(window=window):
                context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _tick(self, context: bpy.types.Context, job: Job) -> set[str]:
        result = job.tick()
        slot.show(job)
        if result is None:
            return {"PASS_THROUGH"}
        slot.end(job)
        return self.apply(context, job, result)

    def _stop(self, context: bpy.types.Context, job: Job) -> set[str]:
        slot.stop(job)
        return self.stopped(context, job)

    def _ending(self, context: bpy.types.Context, step: Callable[[], set[str]]) -> set[str]:
        """The result of `step`. Whatever it raises ends the job, and becomes one sentence; nothing else ends it that way.

        What nobody foresaw may have come in the middle of writing: it gets an undo step of its own, so that it can be undone.
        """
        try:
            result = step()
        except slot.BusyError as error:
            return self.busy(error)
        except GssmcError as error:
            result = self._broken(context, rpt_(str(error)))
        except Exception as error:
            log.exception("The work broke off")
            self._broken(context, sentence(error))
            result = {"FINISHED"}
        if result.isdisjoint({"RUNNING_MODAL", "PASS_THROUGH"}):
            self._job = None  # Blender keeps the operator in its history, so the job must be let go.
        return result

    def _broken(self, context: bpy.types.Context, message: str) -> set[str]:
        job = self._job
        if job is None:
            return self.refuse(context, message)
        slot.stop(job)
        return self.broke_off(context, job, message)


class AskingJobOperator(JobOperator):
    """A mixin for jobs that a dialog or the file browser comes before: `invoke` sets `asked`, and Blender calls `execute`."""

    asked = False

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Runs beside Blender after the dialog, and blocks when a script calls it."""
        return self.begin(context) if self.asked else super().execute(context)
