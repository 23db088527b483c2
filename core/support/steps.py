"""Work that is a generator: it yields progress after each step and returns its result."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeVar

Step = TypeVar("Step")
Other = TypeVar("Other")
Result = TypeVar("Result")


def run_to_end(work: Generator[Step, None, Result], on_progress: Callable[[Step], None] | None = None) -> Result:
    """What `work` returns. `on_progress` is called after each step; what it raises stops the work and passes through."""
    try:
        while True:
            try:
                step = next(work)
            except StopIteration as end:
                result: Result = end.value
                return result
            if on_progress is not None:
                on_progress(step)
    finally:
        work.close()


def converted(work: Generator[Step, None, Result], convert: Callable[[Step], Other]) -> Generator[Other, None, Result]:
    """The same work with each step as `convert` makes it of the original one."""
    try:
        while True:
            try:
                step = next(work)
            except StopIteration as end:
                result: Result = end.value
                return result
            yield convert(step)
    finally:
        work.close()
