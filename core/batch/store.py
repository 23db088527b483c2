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
from itertools import chain
from pathlib import Path
from types import TracebackType

from ..errors import GssmcError
from ..pose.shared_records import OWN, own_record
from ..support.atomic import atomic_write, remove_parts, sync_folder
from ..support.lock import open_locked
from ..support.words import counted
from .records import Gist, KeptRecords, Record, whole_write

log = logging.getLogger(__name__)

Line = tuple[Record, str]  # a record and its JSON text

HEAD = '{"frames": [\n'  # a record per line follows, so that a file cut short still gives up its whole lines
END = "]}\n"
JOURNAL_HEAD = '{"gssmc_journal": 1}\n'
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
        text = json.dumps({**record, "key": self._keys[index]})
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
        self.records.put(index, json.dumps({**named, "key": self._keys[index]}), Gist.of(record))
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
        shared = False
        for frame, text in chain(result_lines(self._path), journal_lines(self._journal)):
            if not frame["verdict"] or "error" in frame:
                continue
            if frame["key"] not in places:
                others[frame["key"]] = text
                continue
            shared = shared or OWN in frame
            own = own_record(frame) if OWN in frame else frame
            for index in places[frame["key"]]:
                self.records.put(index, json.dumps(own) if OWN in frame else text, Gist.of(own))
        if others:
            old = self._path.with_name(f"{self._path.name}.old")
            _save(old, HEAD, [*others.values(), *self._texts()])
            log.warning("%d results of other photos or options in '%s' are kept in '%s'", len(others), self._path, old)
        self._changed = os.fstat(self._handle).st_size > 0
        self._compact()
        # Until it is known what is shared now, the results of the earlier run stay as they are.
        self._changed = shared or self._head != HEAD

    def _texts(self) -> Iterator[str]:
        return (self.records.text(index) for index in sorted(self.records))

    def _compact(self) -> None:
        """Writes the results file from all records, and only then empties the journal."""
        if not self._changed:
            return
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


def heads(shard: Record | None) -> tuple[str, str]:
    """The first lines of the results file and of its journal; `shard` is what the results of a shard say of themselves."""
    if shard is None:
        return HEAD, JOURNAL_HEAD
    said = json.dumps(shard)
    return f'{{"shard": {said}, {HEAD[1:]}', f'{JOURNAL_HEAD[:-2]}, "shard": {said}}}\n'


def is_head(line: str) -> bool:
    """Whether `line` begins a results file as we write it."""
    return line == HEAD or (line.startswith('{"shard": ') and line.endswith(HEAD[1:]))


def result_lines(path: Path) -> Iterator[Line]:
    """The records of a results file, of one cut short the whole ones; none where there is no file. Raises ResultsError."""
    try:
        if path.exists():
            yield from _checked(_frames(path))
    except (ValueError, KeyError, TypeError):
        raise ResultsError(f"'{path}' exists and is no results file of a batch; give another --out.") from None


def journal_lines(path: Path) -> Iterator[Line]:
    """The whole records of a journal, which a killed run left or a run is writing. Raises ResultsError."""
    try:
        with path.open(encoding="utf-8", errors="replace") as lines:
            head = lines.readline()
            # A run may be killed while it writes even that.
            if not JOURNAL_HEAD.startswith(head) and not head.startswith(f"{JOURNAL_HEAD[:-2]},"):
                raise ValueError
            yield from _checked(_whole_lines(lines, path))
    except (ValueError, KeyError, TypeError):
        raise ResultsError(f"'{path}' exists and is no journal of a batch; give another --out.") from None


def _frames(path: Path) -> Iterator[Line]:
    """The records of a results file, of one cut short (a full disk, a broken copy) those that are whole.

    Raises ValueError, KeyError or TypeError when the file is something else.
    """
    with path.open(encoding="utf-8", errors="replace") as lines:
        ours = is_head(lines.readline())
        if ours and _is_lined(lines):
            lines.seek(0)
            lines.readline()
            yield from _whole_lines(lines, path)
            return
        lines.seek(0)
        try:
            frames = json.loads(lines.read())["frames"]  # written by another program, perhaps with line breaks of its own
            yield from ((frame, json.dumps(frame)) for frame in frames)
        except json.JSONDecodeError:
            if not ours:
                raise
            lines.seek(0)
            lines.readline()
            yield from _whole_lines(lines, path)


def _is_lined(lines: Iterable[str]) -> bool:
    """Whether what follows has the form in which we write it, without looking into the records."""
    last = ""
    for line in lines:
        if last and not (last.startswith("{") and last.endswith("},\n" if line != END else "}\n")):
            return False
        last = line
    return last == END


def _whole_lines(lines: Iterable[str], path: Path) -> Iterator[Line]:
    """The records of lines, one each; says how many of `path` are none."""
    damaged, cut = 0, False
    for line in lines:
        text = line.strip().removesuffix(",")
        if text and line != END:
            try:
                record = json.loads(text)
            except json.JSONDecodeError:
                damaged, cut = damaged + 1, not line.endswith("\n")
                continue
            yield record, text
    if damaged == 1 and cut:
        log.warning("The last line of '%s' was cut short; its photo is done again", path)
    elif damaged:
        be, have = ("is", "its photo is") if damaged == 1 else ("are", "their photos are")
        log.warning("%s of '%s' %s damaged; %s done again", counted(damaged, "line"), path, be, have)


def _checked(frames: Iterable[Line]) -> Iterator[Line]:
    """`frames`, as long as they are records. Raises KeyError or TypeError."""
    for frame, text in frames:
        _ = {frame["key"]: frame["verdict"]}
        yield frame, text


def _save(path: Path, head: str, texts: Iterable[str]) -> None:
    with atomic_write(path) as file:
        file.write(head)
        file.writelines(",\n" * (k > 0) + text for k, text in enumerate(texts))
        file.write("\n" + END)
