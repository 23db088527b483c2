"""Sharing the items of a stage out between the calling thread and its helpers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any


class Workers:
    """`threads` threads, the caller's among them: one that only waited would wake for the interpreter lock at every result."""

    def __init__(self, threads: int) -> None:
        self.helpers = max(0, threads - 1)
        self.pool = ThreadPoolExecutor(max(1, self.helpers))

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.pool.shutdown()

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
