"""The records of a batch while it runs: their texts lie in a file without a name, so that ten thousand fit into any memory."""

from __future__ import annotations

import json
import os
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from io import FileIO
from pathlib import Path
from typing import Any

Record = dict[str, Any]

TO_FIND = "to_be_found"  # of a record whose refinement from its start failed, until it has been searched for
UNUSABLE = "not usable"  # the ending of a photo that could not be tried at all
LATER = "to be found"  # the ending of one with TO_FIND


def ending_of(record: Mapping[str, Any]) -> str:
    """A word for what came of a photo: its verdict, UNUSABLE or LATER."""
    if TO_FIND in record:
        return LATER
    return UNUSABLE if "error" in record else str(record["verdict"])


def whole_write(handle: int, data: bytes) -> None:
    """Writes all of `data` to a descriptor. Raises OSError."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(handle, rest) :]


class KeptRecords(Mapping[int, Record]):
    """Records by query index. Each is parsed when it is asked for; `endings` counts them by `ending_of`."""

    def __init__(self, folder: Path) -> None:
        """`folder`: where the file without a name takes its room. The system removes it however the process ends."""
        self._folder = folder
        self._end = 0
        self._places: dict[int, tuple[int, int, str]] = {}  # per index the text's offset, its length in bytes, and the ending
        self.endings: Counter[str] = Counter()

    @cached_property
    def _file(self) -> FileIO:
        # Made with the first record, when the folder is there. Without a buffer, so that a full disk is told at once.
        return tempfile.TemporaryFile(dir=self._folder, buffering=0)

    def put(self, index: int, text: str, ending: str) -> None:
        """Keeps a record's JSON text under `index`, instead of what was there. Raises OSError, and then that is still there."""
        data = text.encode()
        self._file.seek(self._end)
        whole_write(self._file.fileno(), data)
        self._set(index, (self._end, len(data), ending))
        self._end += len(data)

    def place(self, index: int) -> tuple[int, int, str] | None:
        """A mark to `restore` by; None where there is no record."""
        return self._places.get(index)

    def restore(self, index: int, place: tuple[int, int, str] | None) -> None:
        """Puts back what was there when `place` was marked."""
        self._set(index, place)

    def text(self, index: int) -> str:
        """The record's JSON text as it was put. Raises KeyError."""
        offset, length, _ = self._places[index]
        self._file.seek(offset)
        data = bytearray()
        while len(data) < length:
            data += self._file.read(length - len(data)) or b"\0" * length
        return data.decode()

    def ending(self, index: int) -> str | None:
        """`ending_of` the record; None where there is none."""
        place = self._places.get(index)
        return None if place is None else place[2]

    def _set(self, index: int, place: tuple[int, int, str] | None) -> None:
        before = self._places.pop(index, None)
        if before is not None:
            self.endings[before[2]] -= 1
        if place is not None:
            self._places[index] = place
            self.endings[place[2]] += 1

    def __getitem__(self, index: int) -> Record:
        record: Record = json.loads(self.text(index))
        return record

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, index: object) -> bool:
        return index in self._places
