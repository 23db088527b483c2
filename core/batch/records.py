"""The records of a batch while it runs: their texts lie in a file without a name, so that ten thousand fit into any memory."""

from __future__ import annotations

import json
import os
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import FileIO
from pathlib import Path
from typing import Any

from ..cameras.training_world import TAKEN
from ..pose.shared_records import takes_part

Record = dict[str, Any]

TO_FIND = "to_be_found"  # of a record whose refinement from its start failed, until it has been searched for
UNUSABLE = "not usable"  # the ending of a photo that could not be tried at all
LATER = "to be found"  # the ending of one with TO_FIND


@dataclass(frozen=True, slots=True)
class Gist:
    """What is asked of all records at once, so that none has to be read for it.

    ending: the verdict, UNUSABLE or LATER; placed: has a pose; shares: solved a lens that other photos may share; taken: the
    reasons that tell in which world the start was taken to be.
    """

    ending: str
    placed: bool
    shares: bool
    taken: tuple[str, ...] = ()

    @classmethod
    def of(cls, record: Record) -> Gist:
        ending = UNUSABLE if "error" in record else str(record["verdict"])
        taken = tuple(reason for reason in record.get("reasons", ()) if reason.startswith(TAKEN))
        return cls(LATER if TO_FIND in record else ending, record.get("R") is not None, takes_part(record), taken)


def whole_write(handle: int, data: bytes) -> None:
    """Writes all of `data` to a descriptor. Raises OSError."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(handle, rest) :]


# The text's offset and its length in bytes, and what is asked without reading it.
Place = tuple[int, int, Gist]


class KeptRecords(Mapping[int, Record]):
    """Records by query index. Each is parsed when it is asked for; `endings` counts them by their `Gist.ending`."""

    def __init__(self, folder: Path) -> None:
        """`folder`: where the file without a name takes its room. The system removes it however the process ends."""
        self._folder = folder
        self._end = 0
        self._places: dict[int, Place] = {}
        self._gists: dict[Gist, Gist] = {}  # each once, for thousands are equal
        self.endings: Counter[str] = Counter()

    @cached_property
    def _file(self) -> FileIO:
        # Made with the first record, when the folder is there. Without a buffer, so that a full disk is told at once.
        return tempfile.TemporaryFile(dir=self._folder, buffering=0)

    def put(self, index: int, text: str, gist: Gist) -> None:
        """Keeps a record's JSON text under `index`, instead of what was there. Raises OSError, and then that is still there."""
        data = text.encode()
        self._file.seek(self._end)
        whole_write(self._file.fileno(), data)
        self._set(index, (self._end, len(data), self._gists.setdefault(gist, gist)))
        self._end += len(data)

    def place(self, index: int) -> Place | None:
        """A mark to `restore` by; None where there is no record."""
        return self._places.get(index)

    def restore(self, index: int, place: Place | None) -> None:
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

    def gist(self, index: int) -> Gist | None:
        """None where there is no record."""
        place = self._places.get(index)
        return None if place is None else place[2]

    def _set(self, index: int, place: Place | None) -> None:
        before = self._places.pop(index, None)
        if before is not None:
            self.endings[before[2].ending] -= 1
        if place is not None:
            self._places[index] = place
            self.endings[place[2].ending] += 1

    def __getitem__(self, index: int) -> Record:
        record: Record = json.loads(self.text(index))
        return record

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, index: object) -> bool:
        return index in self._places
