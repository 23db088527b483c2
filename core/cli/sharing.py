"""The last step of a batch: photos of one camera get the lens that all of them tell together."""

from __future__ import annotations

from collections.abc import Sequence

from ..batch.keys import BatchQuery
from ..batch.lens_groups import lens_groups
from ..batch.store import ResultStore
from ..pose.shared_records import share_records
from ..support.words import counted
from .console import message, say

SHARED_LENS_HELP = (
    "which photos share their lens, of those that solved it: auto: those of the same camera, lens, focal length and size by "
    "their EXIF, one: all of one size, off: none (auto)"
)


def share_lenses(sharing: str, queries: Sequence[BatchQuery], store: ResultStore) -> None:
    """Puts the records under shared lenses into the store, which holds the photos' own ones, and says one line of each lens.
    The answer depends on these alone, not on the order in which they came.
    """
    groups = lens_groups(sharing, queries, store.records)
    if sharing == "one" and len(groups) > 1:
        message(
            f"The photos have {len(groups)} sizes, and those of each size share a lens: {', '.join(g.name for g in groups)}."
        )
    for group in groups:
        name, members = group.name, group.members
        if len(members) < 2:
            continue
        shared = share_records([store.records[i] for i in members], name)
        if shared is None:
            message(f"The photos of {name} ({len(members)}) agree on no lens, so each keeps its own.")
            continue
        for place, record in shared.records.items():
            store.share(members[place], record)
        of = f" of {name}" if len(groups) > 1 else ""
        say(f"One lens for {counted(shared.count, 'photo')}{of}: {shared.focal}")
        if left := len(members) - shared.count:
            words = "photo keeps its" if left == 1 else "photos keep their"
            message(f"{left} {words} own lens, which is another one.")
