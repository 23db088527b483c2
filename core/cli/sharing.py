"""The last step of a batch: photos of one camera get the lens that all of them tell together."""

from __future__ import annotations

from collections.abc import Sequence

from ..batch.keys import BatchQuery
from ..batch.lens_groups import lens_groups
from ..batch.store import ResultStore
from ..pose.shared_records import share_records
from ..support.words import counted
from .console import message, say

# So many photos are named in one line.
MAX_NAMED = 10
SHARED_LENS_HELP = (
    "which photos share their lens, of those that solved it: auto: those of the same camera, lens, focal length and size by "
    "their EXIF, one: all of one size, off: none (auto)"
)


def share_lenses(sharing: str, queries: Sequence[BatchQuery], store: ResultStore) -> None:
    """Puts the records under shared lenses into the store, which holds the photos' own ones, and says one line of each lens.
    The answer depends on these alone, not on the order in which they came.
    """
    solved = [i for i in store.records if (gist := store.records.gist(i)) is not None and gist.shares]
    groups = lens_groups(sharing, queries, {i: store.records[i] for i in solved})
    if sharing == "one" and len(groups) > 1:
        sizes = ", ".join(f"{g.name} ({counted(len(g.members), 'photo')})" for g in groups)
        message(f"The photos have {len(groups)} sizes, and only photos of one size can share a lens: {sizes}.")
    if sharing == "auto" and not groups and solved:
        message("No lens is shared, because no photo's EXIF tells its camera; if one camera took them, use --shared-lens one.")
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
        if left := [queries[members[place]].photo.name for place in shared.left]:
            more = f" and {len(left) - MAX_NAMED} more" if len(left) > MAX_NAMED else ""
            message(f"With a lens of their own, which is another one: {', '.join(left[:MAX_NAMED])}{more}.")
