"""Work that only Blender's main thread may do, asked for by other threads: drawing with the graphics card.

The main thread does it in slices, so that the window stays alive: a timer calls `serve` while anybody holds the executor, and
so does a job that blocks Blender, whose timers do not run then.
"""

from __future__ import annotations

import logging
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Generator
from typing import Any, TypeVar

import bpy

from ...core.errors import Cancelled

log = logging.getLogger(__name__)

SLICE_S = 0.02  # seconds of a call that may go into work; a single step may take longer
POLL_S = 0.004
# A main thread that does not come by for so long is busy with something else, or waits for the very thread that asks.
LIMIT_S = 60.0
LATE = "Blender's main thread did not come to draw within a minute"
T = TypeVar("T")
Work = Callable[[], Generator[None, None, T]]


class MainThreadBusyError(Exception):
    """The main thread did not come to the work within LIMIT_S."""


class Holder:
    """Stands for one that asks, as long as anybody keeps it."""


class _Task:
    """Work of one asker, and what became of it."""

    def __init__(self, work: Work[Any], owner: Holder) -> None:
        self.work, self.owner = work, owner
        self.steps: Generator[None, None, Any] | None = None
        self.done = threading.Event()
        self.touched = time.monotonic()
        self.result: Any = None
        self.error: BaseException | None = None

    def advance(self) -> None:
        """One step. Main thread, also where the generator is forgotten: it holds textures."""
        if self.done.is_set():
            return
        self.touched = time.monotonic()
        try:
            if self.steps is None:
                self.steps = self.work()
            next(self.steps)
        except StopIteration as end:
            self.result = end.value
            self.done.set()
        except Exception as error:
            log.debug("Work of the main thread failed", exc_info=True)
            # Its frames hold textures, which must not be let go by the thread that asked.
            error.__traceback__ = error.__context__ = error.__cause__ = None
            self.end(error)
        if self.done.is_set():  # also by `release`, in another thread meanwhile
            self.steps = None
        self.touched = time.monotonic()

    def end(self, error: BaseException) -> None:
        self.error = error
        self.done.set()


class MainThreadExecutor:
    """The queue of such work, first come, first served."""

    def __init__(self) -> None:
        self._tasks: deque[_Task] = deque()
        self._holders: weakref.WeakSet[Holder] = weakref.WeakSet()
        self._unused: list[object] = []  # what only the main thread may let go
        self._lock = threading.Lock()
        self._timer = self._tick  # Blender knows a timer by the object, and each look-up of a method makes another

    def hold(self) -> Holder:
        """For one that will ask. Main thread. `release` it in the end."""
        owner = Holder()
        with self._lock:
            self._holders.add(owner)
        if not bpy.app.timers.is_registered(self._timer):
            bpy.app.timers.register(self._timer, persistent=True)
        return owner

    def release(self, owner: Holder) -> None:
        """The owner asks no more; what it asked for raises Cancelled. Any thread."""
        with self._lock:
            self._holders.discard(owner)
            ended = [task for task in self._tasks if task.owner is owner]
            self._tasks = deque(task for task in self._tasks if task.owner is not owner)
        for task in ended:
            self.let_go(task.steps)
            task.steps = None
            task.end(Cancelled("Rendering was cancelled."))

    def close(self) -> None:
        """Nobody asks any more, as when the extension is switched off. Main thread."""
        for owner in list(self._holders):
            self.release(owner)
        self.empty()
        if bpy.app.timers.is_registered(self._timer):
            bpy.app.timers.unregister(self._timer)

    def let_go(self, unused: object) -> None:
        """Forgets textures and what holds them, in the main thread, for no other may free them. Any thread."""
        with self._lock:
            self._unused.append(unused)

    def empty(self) -> None:
        """Forgets what was given to `let_go`. Main thread."""
        with self._lock:
            unused, self._unused = self._unused, []
        del unused

    def ask(self, work: Work[T], owner: Holder) -> T:
        """What the work returns, or raises. It is a generator's making; the main thread may pause at each of its yields.

        In the main thread it is done at once, after what was asked for before: pieces of work may share what they work on.
        Raises Cancelled when the owner is released meanwhile, MainThreadBusyError when the main thread does not come.
        """
        task = _Task(work, owner)
        if threading.current_thread() is threading.main_thread():
            while self.serve():
                pass
            while not task.done.is_set():
                task.advance()
        else:
            with self._lock:
                if owner not in self._holders:
                    raise Cancelled("Rendering was cancelled.")
                self._tasks.append(task)
            self._wait(task)
        if task.error is not None:
            raise task.error
        result: T = task.result
        return result

    def _wait(self, task: _Task) -> None:
        """Until it is done. A task waits for those before it, so any that advanced counts as the main thread's coming."""
        while not task.done.wait(0.5):
            with self._lock:
                waiting = list(self._tasks)
                if task not in waiting or time.monotonic() - max(t.touched for t in waiting) < LIMIT_S:
                    continue
                self._tasks.remove(task)
            self.let_go(task.steps)
            task.steps = None
            task.end(MainThreadBusyError(LATE))

    def serve(self, seconds: float = SLICE_S) -> bool:
        """Works for that long, at least one step. Main thread. True when there is more to do."""
        self.empty()
        end = time.perf_counter() + seconds
        while True:
            with self._lock:
                task = self._tasks[0] if self._tasks else None
            if task is None:
                return False
            task.advance()
            if task.done.is_set():
                with self._lock:
                    if task in self._tasks:
                        self._tasks.remove(task)
            if time.perf_counter() >= end:
                return bool(self._tasks)

    def wait(self, join: Callable[[float], bool], seconds: float) -> bool:
        """`join(seconds)` of a thread that may ask: the main thread serves meanwhile. True when the thread has ended."""
        end = time.perf_counter() + seconds
        if threading.current_thread() is not threading.main_thread():
            return join(seconds)
        while self._holders:
            more = self.serve()
            left = end - time.perf_counter()
            if left <= 0:
                return join(0.0)
            if not more and join(min(left, POLL_S)):
                return True
        return join(max(0.0, end - time.perf_counter()))

    def _tick(self) -> float | None:
        more = self.serve()
        if more:
            return 0.0
        return POLL_S if self._holders or self._unused else None


executor = MainThreadExecutor()  # there is one main thread, and jobs, timers and renderers have no other common place
