"""What the command line says to people: results on stdout, everything else on stderr. The engine itself only logs."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """A line of result."""
    sys.stdout.write(text + "\n")


def message(text: str, end: str = "\n") -> None:
    """A line beside the result: progress, warnings, errors."""
    sys.stderr.write(text + end)
    sys.stderr.flush()
