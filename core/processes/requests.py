"""The child's side of a channel: its requests, one after the other, and where the answers go."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Sequence
from io import BufferedIOBase
from typing import Any

from numpy.typing import NDArray

from .child import pipes
from .wire import Arrays, Header, receive, send

Message = tuple[Header, Arrays]


class Requests:
    """Made once, first of all, by the module that a child runs.

    The end of the input ends the process at once, whatever it is doing: its parent is gone then, also when that was killed,
    and nobody waits for the answer.
    """

    def __init__(self) -> None:
        asked, self._answers = pipes()
        self._waiting: queue.SimpleQueue[Message] = queue.SimpleQueue()
        threading.Thread(target=self._listen, args=(asked,), daemon=True).start()

    def next(self) -> Message:
        """Waits for the next request."""
        return self._waiting.get()

    def answer(self, header: Header, arrays: Sequence[NDArray[Any]] = ()) -> None:
        send(self._answers, header, arrays)

    def _listen(self, asked: BufferedIOBase) -> None:
        try:
            while (message := receive(asked)) is not None:
                self._waiting.put(message)
        finally:
            os._exit(0)
