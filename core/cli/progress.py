"""A progress bar on stderr: redrawn in place on a terminal, a line per tenth elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from .console import message

WIDTH = 28
# The remaining time is not estimated from less progress than this.
MIN_GAIN = 0.02


class ProgressBar:
    """Used as a context manager; `show` may be called from one thread at a time."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._began = time.monotonic()
        self._terminal = sys.stderr.isatty()
        self._first: float | None = None
        self._last_tenth = -1
        self._drawn = 0

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._terminal and self._drawn:
            message("")

    def show(self, fraction: float, text: str) -> None:
        """Draw `fraction` 0..1 with a few words on what is going on."""
        fraction = min(max(fraction, 0.0), 1.0)
        self._first = fraction if self._first is None else self._first  # a resumed batch does not begin at 0
        tenth = int(fraction * 10)
        if not self._terminal and tenth == self._last_tenth:
            return
        self._last_tenth = tenth
        bar = "#" * round(fraction * WIDTH)
        line = f"{self._label} [{bar:<{WIDTH}}] {fraction:4.0%}  {text}{self._remaining(fraction)}"
        if self._terminal:
            message(f"\r{line:<{self._drawn}}", end="")
            self._drawn = len(line)
        else:
            message(line)

    def _remaining(self, fraction: float) -> str:
        gained = fraction - (self._first or 0.0)
        if gained < MIN_GAIN or fraction >= 1.0:
            return ""
        left = round((time.monotonic() - self._began) * (1 - fraction) / gained)
        return f", {left // 60}:{left % 60:02d} left"
