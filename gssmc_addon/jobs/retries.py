"""A queue with a second pass, in which each item that failed gets a few more tries from other starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..splat.copy import SplatCopying
from .machine import QueueJob
from .worker import Steps


class RetryQueue(QueueJob):
    """`items` pieces of work. What was not solved in the first pass is tried again from `other_starts`, one after the other,
    until one of them settles it. What could not begin, or broke off, is not tried again: no start would change that.
    """

    def __init__(self, items: int, copying: SplatCopying | None = None) -> None:
        super().__init__(items, copying)
        self.items = items
        # A start of None means the item's own start.
        self._order: list[tuple[int, Any]] = [(item, None) for item in range(items)]
        self._unsolved: list[int] = []
        self._again, self._again_count = 0, 0  # The number of the item in the second pass, and their count.

    def begin_try(self, item: int, start: Any) -> Callable[[], Steps]:
        """Copies the item out of Blender; `start` is None in the first pass. GssmcError makes it a failure."""
        raise NotImplementedError

    def end_try(self, item: int, start: Any, result: Any) -> bool:
        """Takes the result; whether the item is settled. GssmcError makes it a failure."""
        raise NotImplementedError

    def fail_try(self, item: int, start: Any, message: str) -> None:
        """Notes why the try could not begin, or broke off."""
        raise NotImplementedError

    def other_starts(self, item: int) -> Sequence[Any]:
        """The starts for an unsolved item. It is called when its turn comes, so that items solved by then are included."""
        raise NotImplementedError

    def gave_up(self, item: int) -> None:
        """None of the other starts settled the item."""

    @property
    def place(self) -> tuple[int, int]:
        """The number of the item in its pass, from 1, and the pass's count."""
        return (self._again, self._again_count) if self._again else (self.index + 1, self.items)

    def progress(self, of_item: float) -> float:
        """The share of the pass that is done, where `of_item` of the present try is."""
        number, count = self.place
        if not self._again:
            return (number - 1 + of_item) / count
        item = self._order[self.index][0]
        tries = [index for index, (other, start) in enumerate(self._order) if other == item and start is not None]
        return (number - 1 + (tries.index(self.index) + of_item) / len(tries)) / count

    def begin_item(self, index: int) -> Callable[[], Steps]:
        self.fraction = self.progress(0.0)
        return self.begin_try(*self._order[index])

    def end_item(self, index: int, result: Any) -> None:
        item, start = self._order[index]
        settled = self.end_try(item, start, result)
        if start is None and not settled:
            self._unsolved.append(item)
        self._go_on(index, settled)

    def fail_item(self, index: int, message: str) -> None:
        self.fail_try(*self._order[index], message)
        self._go_on(index, settled=False)

    def _go_on(self, index: int, settled: bool) -> None:
        """Drops tries that are no longer needed, and appends those of the next unsolved item when all others are done."""
        item, start = self._order[index]
        if start is not None and settled:
            self._order = [(other, s) for k, (other, s) in enumerate(self._order) if k <= index or other != item]
        elif start is not None and index == len(self._order) - 1:
            self.gave_up(item)
        if index >= self.items - 1 and not self._again:
            self._again_count = len(self._unsolved)
        while self._unsolved and index == len(self._order) - 1:
            following = self._unsolved.pop(0)
            self._again += 1
            self._order += [(following, other) for other in self.other_starts(following)]
        self.count = len(self._order)
