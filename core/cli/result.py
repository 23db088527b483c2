"""The end of a command that places one photo: its result as JSON, and a line for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..support.atomic import atomic_write
from ..support.words import counted
from .console import message, say


def put_result(out: Path | None, record: dict[str, Any]) -> None:
    """Writes the record to `out` and says one line of it, or says the whole where there is no `out`. Raises OSError."""
    text = json.dumps(record, indent=1)
    if out is None:
        say(text)
        message(summary(record))
        return
    write_json(out, record)
    say(summary(record))


def write_json(out: Path, data: dict[str, Any]) -> None:
    """Writes `data` in one step. Raises OSError, after it said it: what was found is not lost."""
    text = json.dumps(data, indent=1)
    try:
        with atomic_write(out) as file:
            file.write(text + "\n")
    except OSError:
        say(text)
        raise


def summary(record: dict[str, Any]) -> str:
    """One line for people."""
    if record["verdict"] == "pinned":
        return " ".join(record["reasons"])
    after = f"after {counted(len(record['iterations']), 'iteration')}, {record['seconds']:.1f} s"
    return f"{record['verdict']} {after}. {' '.join(record['reasons'])}"
