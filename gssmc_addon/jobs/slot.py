"""The one job of this Blender: where it begins, and the one place where it ends, whatever ends it."""

from __future__ import annotations

import logging

import bpy

from ...core.errors import GssmcError
from ..support.texts import iface_, rpt_
from .machine import Job, redraw

log = logging.getLogger(__name__)
SHUTDOWN_JOIN_S = 5.0


class BusyError(GssmcError):
    """A job runs already."""


class _JobHolder:
    """The job, the timer that drives it, and what stands in the status bar."""

    def __init__(self) -> None:
        self.job: Job | None = None
        self.timer: bpy.types.Timer | None = None
        self.status = ""


_holder = _JobHolder()  # a modal operator and a panel have no other common place that is not saved into the .blend


def active() -> Job | None:
    """The running job, for the panel and Cancel."""
    return _holder.job


def check_free() -> None:
    """Raises BusyError while a job runs. Poll says so too, but Blender does not ask it again after a file browser."""
    if _holder.job is not None:
        raise BusyError(rpt_("Another job of GS-SMC is running; wait for it or cancel it, then try again."))


def home(context: bpy.types.Context) -> bpy.types.Window | None:
    """The window that a job belongs to: that of the user, unless it is one to be closed soon, such as the preferences."""
    here = context.window
    if here is None or here.screen.is_temporary:
        others = [window for window in context.window_manager.windows if not window.screen.is_temporary]
        return others[0] if others else here
    return here


def begin(context: bpy.types.Context, job: Job) -> None:
    """Makes `job` the running one and starts its thread and its timer. Raises BusyError while another one runs."""
    check_free()
    _holder.job = job
    manager = context.window_manager
    try:
        _holder.timer = manager.event_timer_add(job.tick_s, window=home(context))
        if job.at_mouse:
            manager.progress_begin(0, 100)
        _set_status(iface_(job.status))
        job.start()
    except BaseException:
        stop(job)
        raise


def show(job: Job) -> None:
    """Shows the progress also where the panel is closed: at the mouse, and in the status bar, which redraws slowly."""
    if job is not _holder.job:
        return
    if job.at_mouse:
        bpy.context.window_manager.progress_update(100 * job.fraction)
    status = iface_(job.status)
    if status != _holder.status:
        _set_status(status)


def stop(job: Job) -> None:
    """Cancels `job`, which removes its unfinished results, and ends it."""
    try:
        job.cancel()
    except Exception:  # Whatever goes wrong at the end of a job, the slot must become free.
        log.exception("The job could not take back what it made")
    end(job)


def end(job: Job) -> None:
    """Closes and forgets `job` and stops its timer; harmless when that was done already."""
    try:
        job.close()
    except Exception:  # The result is valid all the same.
        log.exception("The job could not be closed")
    if _holder.job is job:
        _release(job)


def _release(job: Job) -> None:
    timer, _holder.job, _holder.timer = _holder.timer, None, None
    manager = bpy.context.window_manager
    if timer is not None:
        manager.event_timer_remove(timer)
        if job.at_mouse:
            manager.progress_end()
    _set_status(None)
    redraw()


def _set_status(text: str | None) -> None:
    """Sets the text in every workspace, because the user may switch to another one."""
    _holder.status = text or ""
    for workspace in bpy.data.workspaces:
        workspace.status_text_set(text)


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    if _holder.job:
        stop(_holder.job)


def register() -> None:
    bpy.app.handlers.load_pre.append(_before_load)


def unregister() -> None:
    """Cancels a running job first, so that nothing of it outlives the extension."""
    job = _holder.job
    if job:
        stop(job)
        job.join(SHUTDOWN_JOIN_S)
    bpy.app.handlers.load_pre.remove(_before_load)
