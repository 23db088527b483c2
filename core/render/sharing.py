"""Sharing the work of a stage among the calling thread and helper threads."""

from __future__ import annotations

import contextlib
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any

# Of the values tried (1, 0.2, 0.1 ms and less) this is the largest that gives a frame the whole gain.
HANDOVER_S = 2e-4


@contextlib.contextmanager
def quick_handover() -> Iterator[None]:
    """The interpreter lock changes hands after HANDOVER_S at the latest, in all of the process; afterwards as before.

    A thread that makes short calls into numpy releases the lock and takes it again before the thread that waits for it can
    run, and this may go on until the switch interval has passed. Where the interval is short already it is left as it is: of
    frames that overlap, the first one sets the interval and restores it, so that the last one cannot leave it changed.
    """
    before = sys.getswitchinterval()
    # Python rounds the interval to whole microseconds, hence the margin.
    if before <= 1.01 * HANDOVER_S:
        yield
        return
    sys.setswitchinterval(HANDOVER_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


class ThreadTeam:
    """`threads` threads that do the items of a stage. The calling thread is one of them: if it only waited, every result would
    wake it, and it would take the interpreter lock from the others.
    """

    def __init__(self, threads: int) -> None:
        self.helpers = max(0, threads - 1)
        self.pool = ThreadPoolExecutor(max(1, self.helpers))
        self.handover = quick_handover() if self.helpers else contextlib.nullcontext()

    def __enter__(self) -> ThreadTeam:
        self.handover.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.pool.shutdown()
        self.handover.__exit__(kind, error, trace)

    def run(self, function: Callable[..., Any], *columns: Any) -> list[Any]:
        """What `function` returns for each item, as `map` has it; the first error ends the work and is raised."""
        items = list(zip(*columns, strict=True))
        out: list[Any] = [None] * len(items)
        todo = deque(enumerate(items))

        def work() -> None:
            try:
                while True:
                    try:
                        i, item = todo.popleft()
                    except IndexError:
                        return
                    out[i] = function(*item)
            except BaseException:
                todo.clear()
                raise

        helping = [self.pool.submit(work) for _ in range(min(self.helpers, len(items) - 1))]
        try:
            work()
        finally:
            for h in helping:
                h.exception()
        for h in helping:
            h.result()
        return out
