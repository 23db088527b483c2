"""Reading what a batch has stored: a record a line, of a damaged file those that are whole, one after the other."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..support.sealed import is_sound
from ..support.words import counted
from .records import Record

HEAD = '{"frames": [\n'  # a record per line follows, so that a file cut short still gives up its whole lines
END = re.compile(r'\](?:, "sum": "([0-9a-f]{32})")?\}\n')  # with a checksum of the records' lines before it
JOURNAL_HEAD = '{"gssmc_journal": 1}\n'
SUM_BYTES = 16
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

    @cached_property
    def _form(self) -> tuple[bool, bool]:
        """Whether the file has the form in which we write it, and also the checksum that we gave it as a whole; without looking
        into the records.
        """
        if self.begins is not is_head:
            with self.path.open(encoding="utf-8", errors="replace") as lines:
                return self.begins(lines.readline()), False
        with self.path.open("rb") as file:
            first = file.readline().decode("utf-8", "replace")
            return _form_of(file) if is_head(first) else (False, False)

    def __iter__(self) -> Iterator[tuple[Record, str, bool]]:
        if not self._is_ours():
            raise ValueError("another file")
        known = self.is_exact
        for frame, text in self._frames():
            if _is_record(frame):
                yield frame, text, known or is_sound(frame)
            elif text:
                self.damaged += 1
                self.cut = self.damaged == 1 and not text.endswith("\n")

    @property
    def is_exact(self) -> bool:
        """Whether a results file is to the last byte as we wrote it."""
        return self._form[1]

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
        whole = None if self._form[0] else self._whole()
        if whole is not None:
            yield from ((frame, json.dumps(frame)) for frame in whole)
            return
        with self.path.open(encoding="utf-8", errors="replace") as lines:
            if not self.begins(lines.readline()):
                lines.seek(0)
            for line in lines:
                text = line.strip().removesuffix(",")
                if text and not END.fullmatch(line):
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


def _form_of(lines: Iterable[bytes]) -> tuple[bool, bool]:
    """`StoredRecords._form` of what follows the head."""
    digest, last = hashlib.blake2b(digest_size=SUM_BYTES), b""
    for line in lines:
        if last:
            digest.update(last)
            is_last = line.startswith(b"]")
            if not (last.startswith(b"{") and last.endswith(b"}\n" if is_last else b"},\n")):
                return False, False
        last = line
    end = END.fullmatch(last.decode("utf-8", "replace"))
    return end is not None, end is not None and end[1] == digest.hexdigest()


def lines_of(head: str, texts: Iterable[str]) -> Iterator[str]:
    """A results file of records' JSON texts, piece by piece."""
    yield head
    digest, last = hashlib.blake2b(digest_size=SUM_BYTES), ""
    for text in texts:
        if last:
            digest.update(f"{last},\n".encode())
            yield f"{last},\n"
        last = text
    if last:
        digest.update(f"{last}\n".encode())
    yield f'{last}\n], "sum": "{digest.hexdigest()}"}}\n'
