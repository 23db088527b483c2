"""Reading what a batch has stored: a record a line, of a damaged file those that are whole, one after the other."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..support.sealed import is_sound
from ..support.words import counted
from .records import Record

HEAD = '{"frames": [\n'  # a record per line follows, so that a file cut short still gives up its whole lines
END = "]}\n"
JOURNAL_HEAD = '{"gssmc_journal": 1}\n'
NONE = object()  # what a line holds that is no JSON


def heads(shard: Record | None) -> tuple[str, str]:
    """The first lines of the results file and of its journal; `shard` is what the results of a shard say of themselves."""
    if shard is None:
        return HEAD, JOURNAL_HEAD
    said = json.dumps(shard)
    return f'{{"shard": {said}, {HEAD[1:]}', f'{JOURNAL_HEAD[:-2]}, "shard": {said}}}\n'


def is_head(line: str) -> bool:
    """Whether `line` begins a results file as we write it."""
    return line == HEAD or (line.startswith('{"shard": ') and line.endswith(HEAD[1:]))


def is_journal_head(line: str) -> bool:
    """Whether `line` begins a journal, or did until its run was killed while it wrote even that."""
    return JOURNAL_HEAD.startswith(line) or line.startswith(f"{JOURNAL_HEAD[:-2]},")


@dataclass
class StoredRecords:
    """Iterating gives (record, its JSON text, whether it is what was written), and raises ValueError where the file is none of
    ours: it begins otherwise, or holds something else, and no record with a checksum of ours is in it.

    After that, `damaged` counts the lines that held no record, and `cut` says whether the last one was cut short.
    """

    path: Path
    begins: Callable[[str], bool] = is_head
    damaged: int = 0
    cut: bool = False

    def __iter__(self) -> Iterator[tuple[Record, str, bool]]:
        if not self._is_ours():
            raise ValueError("another file")
        for frame, text in self._frames():
            if _is_record(frame):
                yield frame, text, is_sound(frame)
            elif text:
                self.damaged += 1
                self.cut = self.damaged == 1 and not text.endswith("\n")

    @property
    def words(self) -> str:
        """What was damaged, as a sentence; empty where nothing was."""
        if self.damaged == 1 and self.cut:
            return f"The last line of '{self.path}' was cut short; its photo is done again"
        be, have = ("is", "its photo is") if self.damaged == 1 else ("are", "their photos are")
        return f"{counted(self.damaged, 'line')} of '{self.path}' {be} damaged; {have} done again" if self.damaged else ""

    def _is_ours(self) -> bool:
        with self.path.open(encoding="utf-8", errors="replace") as lines:
            well = self.begins(lines.readline())
        others = False
        for frame, _ in self._frames():
            if _is_record(frame) and is_sound(frame):
                return True
            others = others or not (_is_record(frame) or frame is NONE)
        return not others and (well or self._whole() is not None)

    def _frames(self) -> Iterator[tuple[Any, str]]:
        """What stands for records, with their texts."""
        with self.path.open(encoding="utf-8", errors="replace") as lines:
            ours = self.begins(lines.readline())
            lined = ours and (self.begins is not is_head or _is_lined(lines))
        whole = None if lined else self._whole()
        if whole is not None:
            yield from ((frame, json.dumps(frame)) for frame in whole)
            return
        with self.path.open(encoding="utf-8", errors="replace") as lines:
            if ours:
                lines.readline()
            for line in lines:
                text = line.strip().removesuffix(",")
                if text and line != END:
                    frame = _parsed(text)
                    yield frame, line if frame is NONE else text

    def _whole(self) -> list[Any] | None:
        """The records of a results file that another program has written anew; None where it is none."""
        try:
            return list(json.loads(self.path.read_text(encoding="utf-8", errors="replace"))["frames"])
        except (ValueError, LookupError, TypeError):
            return None


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return NONE


def _is_record(frame: Any) -> bool:
    return isinstance(frame, dict) and {"key", "verdict"} <= frame.keys()


def _is_lined(lines: Iterable[str]) -> bool:
    """Whether what follows the head has the form in which we write it, without looking into the records."""
    last = ""
    for line in lines:
        if last and not (last.startswith("{") and last.endswith("},\n" if line != END else "}\n")):
            return False
        last = line
    return last == END
