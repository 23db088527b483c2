"""Work for the viewport in a thread of its own: the window asks, goes on drawing what it has, and picks the answer up later."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

log = logging.getLogger(__name__)
STOP_S = 5.0
Key = tuple[Any, ...]  # what a piece of work is for


class BackThread:
    """One daemon thread, started by the first request and ended by `stop()`. All methods belong to the main thread."""

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._waiting: dict[Key, Callable[[], Any]] = {}
        self._done: list[tuple[Key, Any]] = []
        self._busy = False
        self._stopped = False
        self._thread: threading.Thread | None = None

    def ask(self, key: Key, work: Callable[[], Any]) -> None:
        """Has `work` done, which must not touch Blender; it replaces work with the same key that is still waiting."""
        with self._change:
            self._waiting[key] = work
            if self._thread is None:
                self._stopped = False
                self._thread = threading.Thread(target=self._run, name="gssmc-viewport", daemon=True)
                self._thread.start()
            self._change.notify()

    def answers(self) -> list[tuple[Key, Any]]:
        """Keys and results since the last call; the result of work that broke off is None, and the log says why."""
        with self._change:
            done, self._done = self._done, []
        return done

    def idle(self) -> bool:
        """True when nothing is waiting, in work, or not fetched yet."""
        with self._change:
            return not (self._waiting or self._busy or self._done)

    def stop(self) -> None:
        """Drops all that waits and ends the thread."""
        with self._change:
            thread, self._thread = self._thread, None
            self._stopped = True
            self._waiting.clear()
            self._change.notify()
        if thread:
            thread.join(STOP_S)
        self._done.clear()

    def _run(self) -> None:
        while True:
            with self._change:
                while not self._waiting and not self._stopped:
                    self._change.wait()
                if self._stopped:
                    return
                key = next(iter(self._waiting))
                work = self._waiting.pop(key)
                self._busy = True
            result = _result(work)
            with self._change:
                self._busy = False
                self._done.append((key, result))


def _result(work: Callable[[], Any]) -> Any:
    try:
        return work()
    except Exception:  # One broken or too large splat must not end the thread.
        log.exception("Work for the viewport broke off")
        return None
