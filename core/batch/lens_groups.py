"""Which photos of a batch are of one lens: those of one camera as their files tell it, or all of one size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..photos.taken_with import TakenWith, taken_with
from ..pose.shared_records import takes_part
from .keys import BatchQuery

Record = dict[str, Any]
SHARING = ("auto", "one", "off")


@dataclass(frozen=True)
class LensGroup:
    """Photos of one lens: in words what they have in common, and their indices in rising order."""

    name: str
    members: tuple[int, ...]


def lens_groups(sharing: str, queries: Sequence[BatchQuery], records: Mapping[int, Record]) -> list[LensGroup]:
    """The groups by their first photos. `sharing`, of SHARING: "auto" groups photos whose files tell the same camera, lens,
    focal length and size, "one" those of one size, "off" none. `records`: the photos' own ones; those that solved no lens are
    in no group.
    """
    groups: dict[tuple[TakenWith | None, int, int], list[int]] = {}
    for index in sorted(records):
        record = records[index]
        if sharing == "off" or not takes_part(record):
            continue
        taken = taken_with(queries[index].photo) if sharing == "auto" else None
        if sharing == "one" or taken is not None:
            groups.setdefault((taken, record["width"], record["height"]), []).append(index)
    return [
        LensGroup(str(taken or f"{width} x {height} pixels"), tuple(members))
        for (taken, width, height), members in groups.items()
    ]
