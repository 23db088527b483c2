"""The results of a batch on disk: a journal while it runs, and a results file in the order of the queries when it ends.

The journal lies beside the results file, named as it is with ".journal" behind: a first line that says what it is, then a JSON
record a line. A line is written, and so outlives this process, before the next photo's; the disk is told to keep it through a
loss of power (fsync) at once where photos take longer than SYNC_S, and every SYNC_S where they come faster. A batch that was
killed leaves the journal behind, and the next one takes it up. A line that was cut short is left out, with a word, and its
photo done again. The journal is locked while a batch writes to it, and the system lets go of the lock however the batch ends.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType

from ..errors import GssmcError
from ..pose.shared_records import OWN, own_record
from ..support.atomic import atomic_write, remove_parts, sync_folder
from ..support.lock import is_at, open_locked
from ..support.sealed import sealed
from .lines import HEAD, StoredRecords, heads, is_head, is_journal_head, lines_of
from .records import Gist, KeptRecords, Record, whole_write

log = logging.getLogger(__name__)

MOVED = "its folder was moved or taken away meanwhile, and what is finished stays in its journal there"
SYNC_S = 0.5
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

    def __init__(self, path: Path, keys: list[str], shard: Record | None = None) -> None:
        """`keys`: per query, a digest of everything that its answer depends on. `shard`: what a shard says of itself, at the
        head of both files.
        """
        self._head, self._journal_head = heads(shard)
        self._path = Path(os.path.realpath(path))
        self._journal = self._path.with_name(f"{self._path.name}.journal")
        self._keys = keys
        self._handle = -1
        self._changed = False  # since the results file was written
        self._synced = -SYNC_S  # when the journal was last told to the disk
        self.records = KeptRecords(self._path.parent)

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
        """Add a record; it is in the journal when this returns. Raises OSError, and then the record is not there."""
        text = json.dumps(sealed({**record, "key": self._keys[index]}))
        size, before = os.fstat(self._handle).st_size, self.records.place(index)
        try:
            # Known before it is in the journal: Ctrl-C in the middle must not lose what is there already.
            self.records.put(index, text, Gist.of(record))
            self._changed = True
            whole_write(self._handle, (("" if size else self._journal_head) + text + "\n").encode())
            self._sync()
        except OSError:
            self.records.restore(index, before)
            os.ftruncate(self._handle, size)
            raise

    def _sync(self) -> None:
        if time.monotonic() - self._synced >= SYNC_S:
            os.fsync(self._handle)
            self._synced = time.monotonic()

    def share(self, index: int, record: Record) -> None:
        """The record of a photo whose lens was shared, which holds its own one (`shared_records`), instead of that one. It is
        written with the results file, and not to the journal: it follows from what is there.
        """
        named = {name: value for name, value in record.items() if name != "key"}
        self.records.put(index, json.dumps(sealed({**named, "key": self._keys[index]})), Gist.of(record))
        self._changed = True

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
        places: dict[str, list[int]] = {}
        for index, key in enumerate(self._keys):
            places.setdefault(key, []).append(index)
        others: dict[str, str] = {}
        changed: list[str] = []
        shared = False
        for frame, text, sound in self._stored():
            if not sound:
                changed.append(text)
            elif not frame["verdict"] or "error" in frame:
                continue
            elif frame["key"] not in places:
                others[frame["key"]] = text
            else:
                shared = shared or OWN in frame
                own = sealed(own_record(frame)) if OWN in frame else frame
                for index in places[frame["key"]]:
                    self.records.put(index, json.dumps(own) if OWN in frame else text, Gist.of(own))
        if changed:
            log.warning("%d results in '%s' were changed after they were written, and are made again", len(changed), self._path)
        if others or changed:
            old = self._path.with_name(f"{self._path.name}.old")
            _save(old, HEAD, [*others.values(), *changed, *self._texts()])
            log.warning(
                "%d results of other photos or options in '%s' are kept in '%s'", len(others) + len(changed), self._path, old
            )
        self._changed = self._changed or bool(changed) or os.fstat(self._handle).st_size > 0
        self._compact()
        # Until it is known what is shared now, the results of the earlier run stay as they are.
        self._changed = shared or self._head != HEAD

    def _stored(self) -> Iterator[tuple[Record, str, bool]]:
        """What the results file and then the journal hold, see StoredRecords. Raises ResultsError."""
        files = [(self._path, is_head, "results file")] if self._path.exists() else []
        for path, begins, what in (*files, (self._journal, is_journal_head, "journal")):
            stored = StoredRecords(path, begins)
            try:
                yield from stored
            except ValueError:
                raise ResultsError(f"'{path}' exists and is no {what} of a batch; give another --out.") from None
            if stored.words:
                log.warning("%s", stored.words)
            # What is damaged, or laid out by others, is written anew.
            self._changed = self._changed or bool(stored.words) or not (stored.is_exact or begins is is_journal_head)

    def _texts(self) -> Iterator[str]:
        return (self.records.text(index) for index in sorted(self.records))

    def _compact(self) -> None:
        """Writes the results file from all records, and only then empties the journal."""
        if not self._changed:
            return
        if not is_at(self._handle, self._journal):
            # Written anew, the folder would hide what is in the right one, or be hidden by it when that comes back.
            raise FileNotFoundError(errno.ENOENT, MOVED, str(self._path))
        _save(self._path, self._head, self._texts())
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


def _save(path: Path, head: str, texts: Iterable[str]) -> None:
    with atomic_write(path) as file:
        file.writelines(lines_of(head, texts))
