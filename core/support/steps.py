"""Work that is a generator: it yields progress after each step and returns its result."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from typing import Generic, TypeVar

Step = TypeVar("Step")
Other = TypeVar("Other")
Result = TypeVar("Result")


class _Steps(Generic[Step, Result]):
    """The steps of `work`, to be gone through once; after the last one, `result` is what it returned."""

    result: Result

    def __init__(self, work: Generator[Step, None, Result]) -> None:
        self._work = work

    def __iter__(self) -> Iterator[Step]:
        self.result = yield from self._work


def run_to_end(work: Generator[Step, None, Result], on_progress: Callable[[Step], None] | None = None) -> Result:
    """What `work` returns. `on_progress` is called after each step; what it raises stops the work and passes through."""
    steps = _Steps(work)
    with closing(work):
        for step in steps:
            if on_progress is not None:
                on_progress(step)
    return steps.result


def converted(work: Generator[Step, None, Result], convert: Callable[[Step], Other]) -> Generator[Other, None, Result]:
    """The same work with each step as `convert` makes it of the original one."""
    steps = _Steps(work)
    with closing(work):
        for step in steps:
            yield convert(step)
    return steps.result
