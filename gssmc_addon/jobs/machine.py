"""A job: work in a thread beside Blender, watched from the main thread; and a queue of such work, one item after the other."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import bpy

from ...core.errors import GssmcError, RefineError
from ..render_gpu.executor import executor
from ..splat.copy import SplatCopying
from ..support.texts import iface_, n_, sentence
from .worker import Failure, Finished, Steps, WorkThread

log = logging.getLogger(__name__)
CATEGORY = "GS-SMC"  # the sidebar's tab
TICK_S = 0.1
COPY_S = 0.03  # Seconds of a tick that go into copying a splat; a single attribute may take longer.
SHOW_S = 0.4  # Seconds between redraws of the progress: a redraw takes 0.1 s without a graphics card.


def redraw() -> None:
    """Asks every 3D viewport's sidebar to draw again; not the viewport itself, which may take long with a large splat."""
    areas = (area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    for region in (region for area in areas for region in area.regions if region.type == "UI"):
        region.tag_redraw()


def panel_is_open(context: bpy.types.Context) -> bool:
    """Whether the extension's tab of a sidebar is seen in some window."""
    areas = (area for window in context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    regions = (region for area in areas for region in area.regions if region.type == "UI" and region.width > 1)
    return any(region.active_panel_category == CATEGORY for region in regions)


class Job:
    """`start()` it, then `tick()` from the main thread until that gives a result.

    First comes the splat's copy, where the job needs one: in the main thread, a part of it in each tick. `status` stands in
    the status bar, looked up there; `fraction` (0..1), `step` and `detail` are for the panel's progress bar; `at_mouse`: the
    fraction is shown at the mouse too, for work that is begun elsewhere than in the panel. `tick_s`: seconds between ticks.
    """

    status = n_("Working    Esc: cancel")
    at_mouse = False
    tick_s = TICK_S

    def __init__(self, work: Callable[[], Steps] | None = None, copying: SplatCopying | None = None) -> None:
        self.cancelled = False
        self.fraction, self.step, self.detail = 0.0, "Starting", ""
        self._thread = WorkThread(work) if work else None
        self._copying = copying
        self._unseen, self._shown_at = False, 0.0

    def start(self) -> None:
        """Begins, with the splat's copy if there is one to be made."""
        if self._copying:
            self._copying.start()
        else:
            self.begin()

    def begin(self) -> None:
        """Starts the work itself."""
        if self._thread:
            self._thread.start()

    def run(self) -> Any:
        """Runs the job from start to end and blocks meanwhile. Raises GssmcError as `tick` does."""
        try:
            if self._copying:
                self._copying.finish()
                self._copying = None
            self.start()
            while True:
                result = self.tick()
                if result is not None:
                    return result
                self.join(self.tick_s)
        except BaseException:
            self.cancel()
            raise
        finally:
            self.close()

    def close(self) -> None:
        """Called when the job has ended in any way: releases processes and files."""

    def cancel(self) -> None:
        """Stops the job without waiting, and takes back what it made; its thread ends by itself at its next step."""
        self.cancelled = True
        if self._copying:
            self._copying.stop()
        if self._thread:
            self._thread.stop()

    def join(self, timeout_s: float) -> bool:
        """Waits for the thread that runs now; True when it has ended."""
        return self._thread.join(timeout_s) if self._thread else True

    def check(self) -> None:
        """Raises GssmcError when the job cannot go on because what it works on was removed."""

    def on_progress(self, news: Any) -> None:
        """Takes the progress that a step yielded, for the progress bar."""

    def tick(self) -> Any:
        """The result once there is one. Raises GssmcError when the job cannot go on; it is cancelled then, or at any other
        error.
        """
        try:
            self.check()
            executor.serve()  # Timers, which serve it otherwise, do not run in background mode.
            result = self.advance() if self._copied() else None
            self._show()
            return result
        except BaseException:
            self.cancel()
            raise

    def advance(self) -> Any:
        """Takes the thread's messages; returns the result once there is one."""
        for news in self._thread.news() if self._thread else ():
            if isinstance(news, Failure):
                raise RefineError(news.message)
            if isinstance(news, Finished):
                return news.result
            self.on_progress(news)
            self.show()
        return None

    def show(self) -> None:
        """Requests that the progress is drawn, in this tick or soon after."""
        self._unseen = True

    def _show(self) -> None:
        now = time.perf_counter()
        if self._unseen and now - self._shown_at > SHOW_S:
            self._unseen, self._shown_at = False, now
            redraw()

    def _copied(self) -> bool:
        """Continues the splat's copy and starts the work when it is complete; True when there is nothing left to copy."""
        if self._copying is None:
            return True
        done = self._copying.advance(time.perf_counter() + COPY_S)
        self.step, self.detail = "Copying the splat", iface_("{percent:.0f} %", percent=100 * self._copying.fraction)
        self.show()
        if done:
            self._copying, self.detail = None, ""
            self.begin()
        return done


class QueueJob(Job):
    """`count` pieces of work, one thread after the other. What fails, for whatever reason, fails alone; `result()` ends the
    job.

    A piece is copied out of Blender when its turn comes and forgotten after, so the memory it takes does not add up.
    """

    def __init__(self, count: int, copying: SplatCopying | None = None) -> None:
        super().__init__(copying=copying)
        self.count, self.index = count, -1

    def begin_item(self, index: int) -> Callable[[], Steps]:
        """Copies item `index` out of Blender. GssmcError makes it a failure of this item."""
        raise NotImplementedError

    def end_item(self, index: int, result: Any) -> None:
        """Takes the item's result. GssmcError makes it a failure of this item."""
        raise NotImplementedError

    def fail_item(self, index: int, message: str) -> None:
        """Notes why the item failed."""
        raise NotImplementedError

    def result(self) -> Any:
        raise NotImplementedError

    def begin(self) -> None:
        self._next()

    def advance(self) -> Any:
        if self._thread is None:  # The item failed before its thread was started.
            self._next()
        for news in self._thread.news() if self._thread else ():
            if isinstance(news, Failure):
                self.fail_item(self.index, news.message)
                self._next()
            elif isinstance(news, Finished):
                self._take(news.result)
                self._next()
            else:
                self.on_progress(news)
            self.show()
        return self.result() if self.index >= self.count else None

    def _take(self, result: Any) -> None:
        self._attempt(lambda: self.end_item(self.index, result))

    def _next(self) -> None:
        """Begins the next item, one per call, so that many bad items in a row do not block the window."""
        self._thread = None
        self.index += 1
        if self.index >= self.count or self.cancelled:
            return
        self.fraction = self.index / self.count
        work = self._attempt(lambda: self.begin_item(self.index))
        if work is not None:
            self._thread = WorkThread(work)
            self._thread.start()

    def _attempt(self, step: Callable[[], Any]) -> Any:
        """The result of `step`; None when it raised, which counts as a failure of this item."""
        try:
            return step()
        except GssmcError as error:
            message = str(error)
        except Exception as error:
            log.exception("An item broke off")
            message = sentence(error)
        self.fail_item(self.index, message)
        return None
