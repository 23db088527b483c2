"""The same photo under other spellings: folder separators, `.color`, extensions and leading folders differ between files."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol, TypeVar

from ..errors import CameraError, DatasetError
from ..support.picture_names import PICTURES, file_name, parts_of, spelt
from ..support.words import counted
from .types import short

ENDINGS = "|".join(suffix.removeprefix(".") for suffix in (*PICTURES, ".ppm", ".pgm", ".txt"))
SUFFIX = re.compile(rf"(\.(color|pose))?(\.({ENDINGS}))?$", re.IGNORECASE)
WORDS = re.compile(r"[^\W_]+")


class NamesPhoto(Protocol):
    """A record of a camera file; `file` is the photo's name as the file spells it, empty where it names none."""

    @property
    def file(self) -> str: ...


Record = TypeVar("Record", bound=NamesPhoto)


def record_of_photo(records: Sequence[Record], photo: str, source: str, alone: bool = True) -> Record:
    """The one rule by which a photo gets its start: the file's only record, or the only one that names the photo. `alone`: a
    record that is alone here is so in its file, too.

    Equal file names go before names that differ in case or in how accents are composed, and these before other spellings of
    the same name; of several, the one whose folders are the photo's. Raises CameraError when no record, or more than one, names
    the photo; `source` is the camera file's name in its sentence.
    """
    if len(records) == 1 and alone:
        return records[0]
    name = file_name(photo)
    named: list[Record] = []
    for same in (str, spelt, name_key):
        named = named or [one for one in records if one.file and same(file_name(one.file)) == same(name)]
    named = _in_the_same_folders(named, photo) if len(named) > 1 else named
    if len(named) != 1:
        raise CameraError(
            f"'{source}' holds {counted(len(records), 'camera')}, {len(named)} of them for '{short(name)}'; "
            'give one camera, or one whose "file" names the photo.'
        )
    return named[0]


def _in_the_same_folders(named: Sequence[Record], photo: str) -> list[Record]:
    """Those of which most folders, from the last one on, are the photo's."""
    shared = [_shared_folders(one.file, photo) for one in named]
    return [one for one, count in zip(named, shared, strict=True) if count == max(shared)]


def _shared_folders(name: str, other: str) -> int:
    count = 0
    for a, b in zip(parts_of(name)[-2::-1], parts_of(other)[-2::-1], strict=False):
        if spelt(a) != spelt(b):
            break
        count += 1
    return count


def names_photo(file: str, photo: str) -> bool:
    """Whether a record's `file` spells the name of the photo, folders aside."""
    return name_key(file_name(file)) == name_key(file_name(photo))


def name_key(name: str) -> str:
    """What all spellings of a photo's name share: its words and numbers, without image suffixes.

    'seq-03/frame-000844.color.png', 'seq-03\\frame-000844.pose.txt' and 'seq-03-frame-000844' have one key.
    """
    stem = SUFFIX.sub("", spelt(name), count=1)
    return " ".join(WORDS.findall(stem)) or name


def name_tails(name: str) -> list[str]:
    """Keys of the name without its first folder, without its first two, and so on."""
    parts = parts_of(name)
    return [name_key("/".join(parts[k:])) for k in range(1, len(parts))]


def match_names(wanted: Sequence[str], given: Sequence[str], wanted_in: str, given_in: str) -> list[int | None]:
    """For each wanted name, the index of the same photo in `given`, or None.

    Equal names go together first, then equal keys, then names of which one has more leading folders. Raises DatasetError when
    a name could mean several photos; `wanted_in` and `given_in` name the two files in its sentence.
    """
    exact = {name: i for i, name in enumerate(given)}
    found = [exact.get(name) for name in wanted]
    for candidates in (_by_key, _by_folders):
        free_w = [w for w, g in enumerate(found) if g is None]
        taken = {g for g in found if g is not None}
        free_g = [g for g in range(len(given)) if g not in taken]
        pairs = candidates([wanted[w] for w in free_w], [given[g] for g in free_g])
        owner: dict[int, int] = {}
        for w, matches in pairs.items():
            if len(matches) > 1:
                a, b = sorted(given[free_g[m]] for m in matches)[:2]
                raise _ambiguous(wanted[free_w[w]], wanted_in, a, b, given_in)
            for m in matches:
                if m in owner:
                    raise _ambiguous(given[free_g[m]], given_in, wanted[free_w[owner[m]]], wanted[free_w[w]], wanted_in)
                owner[m] = w
                found[free_w[w]] = free_g[m]
    return found


def _by_key(wanted: Sequence[str], given: Sequence[str]) -> dict[int, set[int]]:
    keys: dict[str, set[int]] = defaultdict(set)
    for g, name in enumerate(given):
        keys[name_key(name)].add(g)
    return {w: keys[name_key(name)] for w, name in enumerate(wanted) if name_key(name) in keys}


def _by_folders(wanted: Sequence[str], given: Sequence[str]) -> dict[int, set[int]]:
    """Pairs of which one name is the other without its leading folders."""
    keys: dict[str, set[int]] = defaultdict(set)
    tails: dict[str, set[int]] = defaultdict(set)
    for g, name in enumerate(given):
        keys[name_key(name)].add(g)
        for tail in name_tails(name):
            tails[tail].add(g)
    out: dict[int, set[int]] = {}
    for w, name in enumerate(wanted):
        matches = tails.get(name_key(name), set()).union(*(keys.get(tail, set()) for tail in name_tails(name)))
        if matches:
            out[w] = matches
    return out


def _ambiguous(name: str, name_in: str, a: str, b: str, others_in: str) -> DatasetError:
    return DatasetError(
        f"'{short(name)}' of '{name_in}' could be '{short(a)}' or '{short(b)}' of '{others_in}'; "
        "spell the names alike, with their folders."
    )
