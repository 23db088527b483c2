"""The results of a batch on disk: a journal while it runs, and a results file in the order of the queries when it ends.

The journal lies beside the results file, named as it is with ".journal" behind: a first line that says what it is, then a JSON
record a line, each on disk before the next photo's. A batch that was killed leaves it behind, and the next one takes it up.
It is locked while a batch writes to it, and the system lets go of the lock however the batch ends.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

from ..errors import GssmcError
from ..pose.shared_records import OWN, own_record
from ..support.atomic import atomic_write, remove_parts, sync_folder
from ..support.lock import is_at, open_locked
from ..support.sealed import is_sound, sealed

log = logging.getLogger(__name__)

Record = dict[str, Any]

HEAD = '{"frames": [\n'  # a record per line follows, so that a file cut short still gives up its whole lines
JOURNAL_HEAD = '{"gssmc_journal": 1}\n'
MOVED = "its folder was moved or taken away meanwhile, and what is finished stays in its journal there"
NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS})


class ResultsError(GssmcError):
    """The results file cannot be used."""


class ResultStore:
    """Records by query index: `records`. A context manager: between its ends no other batch can use the same results file.

    They are the photos' own ones until `share` puts those of a shared lens in their place, as the last step; what an earlier
    run shared is undone when its results are taken over.

    Entering takes over what earlier runs finished for the same queries and options, whole or killed. Photos that could not be
    tried at all (records with "error") are tried again. Finished records of other queries or options go into a file named as
    the results are, with ".old" behind. Leaving writes the results file in one step and removes the journal.
    """

    def __init__(self, path: Path, keys: list[str]) -> None:
        """`keys`: per query, a digest of everything that its answer depends on."""
        self._path = Path(os.path.realpath(path))
        self._journal = self._path.with_name(f"{self._path.name}.journal")
        self._keys = keys
        self._texts: dict[int, str] = {}
        self._handle = -1
        self._changed = False  # since the results file was written
        self._torn = False  # the results file, which is to be written anew even where nothing was lost
        self.records: dict[int, Record] = {}

    def __enter__(self) -> ResultStore:
        """Raises ResultsError when another batch uses the file, or it is something else, rather than overwrite it; OSError
        when its place cannot be written to, before hours of work.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._handle = self._locked()
        try:
            remove_parts(self._path)
            self._resume()
        except BaseException:
            self._release()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self._compact()
        except OSError as problem:
            if error is None:
                raise
            log.warning("The results stay in '%s', for they cannot be written to '%s' (%s)", self._journal, self._path, problem)
        finally:
            self._release()

    def put(self, index: int, record: Record) -> None:
        """Add a record; it is on disk when this returns. Raises OSError, and then the record is not there."""
        text = json.dumps(sealed({**record, "key": self._keys[index]}))
        size, before = os.fstat(self._handle).st_size, (self.records.get(index), self._texts.get(index))
        # Known before it is written: Ctrl-C in the middle must not lose what is in the journal already.
        self.records[index], self._texts[index], self._changed = record, text, True
        try:
            _write(self._handle, ("" if size else JOURNAL_HEAD) + text + "\n")
            os.fsync(self._handle)
        except OSError:
            self._restore(index, *before)
            os.ftruncate(self._handle, size)
            raise

    def share(self, index: int, record: Record) -> None:
        """The record of a photo whose lens was shared, which holds its own one (`shared_records`), instead of that one. It is
        written with the results file, and not to the journal: it follows from what is there.
        """
        named = {name: value for name, value in record.items() if name != "key"}
        self.records[index], self._changed = record, True
        self._texts[index] = json.dumps(sealed({**named, "key": self._keys[index]}))

    def _restore(self, index: int, record: Record | None, text: str | None) -> None:
        del self.records[index], self._texts[index]
        if record is not None and text is not None:
            self.records[index], self._texts[index] = record, text

    def _locked(self) -> int:
        try:
            handle = open_locked(self._journal)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            log.warning("'%s' lies where files cannot be locked; start no second batch on it", self._path)
            return os.open(self._journal, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        if handle is None:
            raise ResultsError(f"Another batch is writing to '{self._path}'; wait for its end, or give another --out.")
        return handle

    def _resume(self) -> None:
        found = [*self._results(), *self._journalled()]
        sound = [frame for frame in found if is_sound(frame)]
        usable = {frame["key"]: frame for frame in sound if frame["verdict"] and "error" not in frame}
        for index, key in enumerate(self._keys):
            if key in usable:
                own = own_record(usable[key])
                self.records[index], self._texts[index] = own, json.dumps(sealed(own))
        wanted = set(self._keys)
        others = [json.dumps(frame) for key, frame in usable.items() if key not in wanted]
        if damaged := [json.dumps(frame) for frame in found if not is_sound(frame)]:
            log.warning("%d results in '%s' were changed after they were written, and are made again", len(damaged), self._path)
            others += damaged
            self._torn = True
        if others:
            old = self._path.with_name(f"{self._path.name}.old")
            _save(old, [*others, *self._texts.values()])
            log.warning("%d results of other photos or options in '%s' are kept in '%s'", len(others), self._path, old)
        self._changed = os.fstat(self._handle).st_size > 0 or self._torn
        self._compact()
        # Until it is known what is shared now, the results of the earlier run stay as they are.
        self._changed = any(OWN in frame for key, frame in usable.items() if key in wanted)

    def _results(self) -> list[Record]:
        """The records of the results file, of a damaged one those that are whole. Raises ResultsError."""
        if not self._path.exists():
            return []
        text = self._path.read_text(encoding="utf-8", errors="replace")
        try:
            found = _json_frames(text)
            records = _checked(_rescued(text, text.startswith(HEAD)) if found is None else found)
        except ValueError:
            raise ResultsError(f"'{self._path}' exists and is no results file of a batch; give another --out.") from None
        self._torn = found is None or len(records) < len(found)
        return records

    def _journalled(self) -> list[Record]:
        """The whole records that a killed run left in the journal. Raises ResultsError."""
        text = self._journal.read_text(encoding="utf-8", errors="replace")
        head = JOURNAL_HEAD[: len(text)]  # a run may be killed while it writes even that
        try:
            return _checked(_rescued(text, text.startswith(head)))
        except ValueError:
            raise ResultsError(f"'{self._journal}' exists and is no journal of a batch; give another --out.") from None

    def _compact(self) -> None:
        """Writes the results file from all records, and only then empties the journal."""
        if not self._changed:
            return
        if not is_at(self._handle, self._journal):
            # Written anew, the folder would hide what is in the right one, or be hidden by it when that comes back.
            raise FileNotFoundError(errno.ENOENT, MOVED, str(self._path))
        _save(self._path, [self._texts[index] for index in sorted(self._texts)])
        sync_folder(self._path.parent)
        os.ftruncate(self._handle, 0)
        self._changed = False

    def _release(self) -> None:
        """Lets go of the journal, and removes it unless it holds what the results file does not."""
        empty = os.fstat(self._handle).st_size == 0
        if empty and os.name != "nt":
            self._journal.unlink(missing_ok=True)  # while it is locked: nobody can have begun to write to it
        os.close(self._handle)
        if empty and os.name == "nt":
            with contextlib.suppress(OSError):  # another batch has it open already
                self._journal.unlink(missing_ok=True)


def _json_frames(text: str) -> list[Any] | None:
    """What a results file's text holds as records; None where it is damaged, or another file's."""
    try:
        return list(json.loads(text)["frames"])
    except (ValueError, KeyError, TypeError):
        return None


def _rescued(text: str, begins_well: bool) -> list[Any]:
    """What the whole lines of a damaged file hold (a run that was killed, a full disk, a broken copy).

    Raises ValueError when the file begins as none of ours does, and none of the lines is certainly ours.
    """
    found: list[Any] = []
    for line in text.splitlines():
        if f"{line}\n" not in (HEAD, JOURNAL_HEAD):
            with contextlib.suppress(json.JSONDecodeError):
                found.append(json.loads(line.rstrip(",")))
    if not begins_well and not any(map(_is_sound, found)):
        raise ValueError("another file")
    return found


def _checked(frames: list[Any]) -> list[Record]:
    """The records among `frames`. Raises ValueError when there is something else, unless it stands beside sound records."""
    records = [one for one in frames if isinstance(one, dict) and {"key", "verdict"} <= one.keys()]
    if len(records) < len(frames) and not any(map(_is_sound, records)):
        raise ValueError("no records")
    return records


def _is_sound(one: Any) -> bool:
    return isinstance(one, dict) and is_sound(one)


def _save(path: Path, texts: Iterable[str]) -> None:
    with atomic_write(path) as file:
        file.write(HEAD)
        file.write(",\n".join(texts))
        file.write("\n]}\n")


def _write(handle: int, text: str) -> None:
    data = memoryview(text.encode())
    while data:
        data = data[os.write(handle, data) :]
