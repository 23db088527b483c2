"""The results file of a batch: always whole on disk, always in the order of the queries, and taken up again by a second run."""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import Any

from ..errors import GssmcError
from ..support.atomic import atomic_write

Record = dict[str, Any]

HEAD = '{"frames": [\n'  # a record per line follows, so that a file cut short still gives up its whole lines


class ResultsError(GssmcError):
    """The results file cannot be used."""


def job_key(*parts: Any) -> str:
    """A short digest of everything that an answer depends on; equal keys mean that it need not be found again."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def _frames(text: str) -> list[Record]:
    """The records of a results file; of one that was cut short (a full disk, a broken copy), those that are whole.

    Raises ValueError, KeyError or TypeError when the text is something else.
    """
    try:
        frames: list[Record] = json.loads(text)["frames"]
        return frames
    except json.JSONDecodeError:
        if not text.startswith(HEAD):
            raise
    whole: list[Record] = []
    for line in text[len(HEAD) :].splitlines():
        with contextlib.suppress(json.JSONDecodeError):
            whole.append(json.loads(line.rstrip(",")))
    return whole


class ResultStore:
    """Records by query index. `save` replaces the file in one step, so that a crash finds the old one or the new one."""

    def __init__(self, path: Path, keys: list[str]) -> None:
        self._path = path
        self._keys = keys
        self._texts: dict[int, str] = {}
        self.records: dict[int, Record] = {}

    def resume(self) -> int:
        """Take over what an earlier run finished for the same queries and options; returns how many.

        Photos that could not be tried at all (records with "error") are tried again. A file cut short gives what is
        whole in it. Raises ResultsError when the file is something else, rather than overwrite it.
        """
        if not self._path.exists():
            return 0
        try:
            frames = _frames(self._path.read_text(encoding="utf-8", errors="replace"))
            usable = {frame["key"]: frame for frame in frames if frame["verdict"] and "error" not in frame}
        except (ValueError, KeyError, TypeError):
            raise ResultsError(f"'{self._path}' exists and is no results file of a batch; give another --out.") from None
        for index, key in enumerate(self._keys):
            if key in usable:
                self._keep(index, usable[key])
        return len(self.records)

    def put(self, index: int, record: Record) -> None:
        """Add a record and save."""
        self._keep(index, {**record, "key": self._keys[index]})
        self.save()

    def save(self) -> None:
        with atomic_write(self._path) as file:
            file.write(HEAD)
            file.write(",\n".join(self._texts[index] for index in sorted(self._texts)))
            file.write("\n]}\n")

    def _keep(self, index: int, record: Record) -> None:
        self.records[index] = record
        self._texts[index] = json.dumps(record)  # kept, because the whole file is written after every photo
