"""A batch in shards: each machine does every N-th photo into a file of its own, and the files are joined afterwards."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...errors import UsageError
from ...pose.settings import RefineSettings
from ...pose.shared_records import OWN, own_record
from ...support.sealed import SUM
from ...support.words import counted
from ..keys import KEY_VERSION, BatchQuery, given, key_of, scan_file_digest
from ..lines import JOURNAL_HEAD, StoredRecords, is_journal_head
from ..records import Record
from ..store import ResultsError

COMPARED = {
    "shards": "their number",
    "scan": "the scan",
    "queries": "the list of photos",
    "options": "what the options say",
    "shared_lens": "what --shared-lens says",
}


@dataclass(frozen=True)
class Shard:
    """The `number`-th of `count` shards, from 1."""

    number: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """From "2/8". Raises UsageError."""
        number, slash, count = text.partition("/")
        if slash and number.strip().isdecimal() and count.strip().isdecimal() and 1 <= int(number) <= int(count):
            return cls(int(number), int(count))
        raise UsageError(f"--shard is '{text}'; give the shard and their number, from 1/8 to 8/8 for eight of them.")

    def of(self, total: int) -> range:
        """Its share of `total` queries, by their indices: every count-th, so that shards of a list in any order cost alike."""
        return range(self.number - 1, total, self.count)

    def file(self, out: Path) -> Path:
        """Where its results lie when the whole batch's are to be `out`."""
        return out.with_name(f"{out.stem}.shard-{self.number}-of-{self.count}{out.suffix}")

    def __str__(self) -> str:
        return f"shard {self.number} of {self.count}"


def shard_head(scan: Path, queries: Sequence[BatchQuery], settings: RefineSettings, word: str) -> Record:
    """What all shards of one batch say alike: what their answers depend on beside the photo. Copies of the scan and of models
    on other machines are the same ones; `word` as in `query_keys`. Raises SplatFormatError.
    """
    options = {name: value for name, value in asdict(settings).items() if name not in ("threads", "model", "matcher_model")}
    models = [Path(name) for name in (settings.model, settings.matcher_model) if name]
    sizes = [(model.name, model.stat().st_size if model.exists() else 0) for model in models]
    return {
        "photos": len(queries),
        "scan": scan_file_digest(scan, dated=False),
        "queries": key_of([given(query) for query in queries]),
        "options": key_of(KEY_VERSION, options, sizes, word),
    }


def own_head(shared: Record, shard: Shard, queries: Sequence[BatchQuery], keys: Sequence[str]) -> Record:
    """`shared`, with the shard's number and its own photos: their `queries` and `keys`."""
    indices = shard.of(shared["photos"])
    own = [[i, query.camera.file, str(query.photo), key] for i, query, key in zip(indices, queries, keys, strict=True)]
    return {"shard": shard.number, "shards": shard.count, **shared, "own": own}


@dataclass(frozen=True)
class ShardPhoto:
    """A photo of a batch as its shard names it: its index among all queries, its name, its file, and its key."""

    index: int
    name: str
    file: Path
    key: str


@dataclass
class Joined:
    """What several shards hold together. `records`: JSON texts by query index; `gaps`, `conflicts`, `damage`: in words what is
    missing, answered twice and otherwise, or left out; `double`: how many are there twice.
    """

    total: int
    shared_lens: str
    photos: dict[int, ShardPhoto] = field(default_factory=dict)
    records: dict[int, Record] = field(default_factory=dict)
    gaps: list[str] = field(default_factory=list)
    missing: int = 0
    double: int = 0
    conflicts: list[str] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)


def find_shards(out: Path) -> list[Path]:
    """The results files of shards that lie beside `out` under their own names, also where only a journal is there."""
    names = {path.name.removesuffix(".journal") for path in out.parent.glob(f"{_escaped(out.stem)}.shard-*-of-*")}
    return sorted(out.with_name(name) for name in names if name.endswith(out.suffix))


def _escaped(text: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in text)


def join(paths: Sequence[Path]) -> Joined:
    """The records of the shards in these files, whole or killed. Raises ResultsError for what is no shard, or is one of another
    scan, list of photos or options than the first.
    """
    files = [_normal(path) for path in paths]
    told = [_head(path) for path in files]
    for path, head in zip(files, told, strict=True):
        for name, words in COMPARED.items():
            if head[name] != told[0][name]:
                raise ResultsError(f"'{files[0]}' and '{path}' are not of one batch, for {words} differs; leave one out.")
    joined = Joined(told[0]["photos"], told[0]["shared_lens"])
    given_by: dict[int, Path] = {}
    for path, head in zip(files, told, strict=True):
        _take(joined, path, head, given_by)
    _name_gaps(joined, told[0]["shards"], {head["shard"] for head in told})
    return joined


def _normal(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(".journal"))


def _head(path: Path) -> Record:
    """What a shard says of itself; its journal's word is the newer one. Raises ResultsError."""
    journal = path.with_name(f"{path.name}.journal")
    if not path.exists() and not journal.exists():
        raise ResultsError(f"There is no shard at '{path}'; check the path.")
    for file in (journal, path):
        try:
            with file.open(encoding="utf-8") as lines:
                line = lines.readline()
                whole = line if line.startswith(JOURNAL_HEAD[:-2]) else f"{line}]}}"
                data = json.loads(whole if line.endswith(("[\n", "}\n")) else line + lines.read())
            head: Record = data["shard"]
            [ShardPhoto(int(i), name, Path(file), key) for i, name, file, key in head["own"]]
            _ = [head[name] for name in (*COMPARED, "photos", "shard")]
            return head
        except (OSError, ValueError, LookupError, TypeError):
            continue
    raise ResultsError(f"'{path}' holds no shard of a batch; give the files that batch --shard has written.")


def _take(joined: Joined, path: Path, head: Record, given_by: dict[int, Path]) -> None:
    """Adds a shard's finished records; the first that is given counts where two differ."""
    own = [ShardPhoto(int(i), name, Path(file), key) for i, name, file, key in head["own"]]
    places: dict[str, list[ShardPhoto]] = defaultdict(list)
    for photo in own:
        joined.photos.setdefault(photo.index, photo)
        places[photo.key].append(photo)
    found: dict[int, Record] = {}
    for frame in _records(joined, path):
        for photo in places.get(frame["key"], ()):
            if photo.index not in found or "error" not in frame:
                found[photo.index] = own_record(frame) if OWN in frame else frame
    for index, record in found.items():
        before = joined.records.get(index)
        if before is None or ("error" in before and "error" not in record):
            joined.records[index], joined.photos[index] = record, next(p for p in places[record["key"]] if p.index == index)
            given_by[index] = path
        elif "error" not in record:
            joined.double += 1
            if _answer(before) != _answer(record):
                name = joined.photos[index].name
                joined.conflicts.append(f"'{name}' has another answer in '{path}' than in '{given_by[index]}', which is taken.")


def _records(joined: Joined, path: Path) -> Iterator[Record]:
    """The sound records of a shard, of its results and then of its journal. Raises ResultsError."""
    journal = path.with_name(f"{path.name}.journal")
    for stored in (StoredRecords(path), StoredRecords(journal, is_journal_head)):
        if not stored.path.exists():
            continue
        changed = 0
        try:
            for frame, _, sound in stored:
                changed += not sound
                if sound and frame["verdict"]:
                    yield frame
        except ValueError:
            raise ResultsError(f"'{stored.path}' holds no records of a batch; leave it out.") from None
        if stored.damaged or changed:
            lines = counted(stored.damaged + changed, "line")
            joined.damage.append(f"'{stored.path}' has {lines} cut short or damaged, which count for nothing.")


def _answer(record: Record) -> dict[str, Any]:
    """All of a record but how long it took, and the key, which knows when a file was copied."""
    return {name: value for name, value in record.items() if name not in ("seconds", "key", SUM)}


def _name_gaps(joined: Joined, shards: int, there: set[int]) -> None:
    """Says for each shard what is missing of it."""
    for number in range(1, shards + 1):
        shard = Shard(number, shards)
        lacking = [i for i in shard.of(joined.total) if i not in joined.records]
        joined.missing += len(lacking)
        if lacking and number not in there:
            joined.gaps.append(f"{shard} ({len(lacking)}), of which there is no file")
        elif lacking:
            names = ", ".join(f"'{joined.photos[i].name}'" for i in lacking[:3])
            more = f" and {len(lacking) - 3} more" if len(lacking) > 3 else ""
            joined.gaps.append(f"{shard} ({names}{more})")
