"""`merge --out RESULTS.json`: the shards of a batch, each done by a machine of its own, as one file of results."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...batch.farm.shards import Joined, find_shards, join
from ...batch.keys import BatchQuery
from ...batch.lines import StoredRecords
from ...batch.store import ResultsError, ResultStore
from ...cameras.pose_list import checked
from ...cameras.unplaced import Unplaced
from ...errors import UsageError
from ...support.words import counted
from ..console import message
from ..outcome import FAILED_VERDICT, OK, Outcome
from ..paths import check_outputs
from ..result import EXIT_ZERO_HELP, say_endings, write_poses
from ..sharing import share_lenses

LISTED = 10  # sentences of one kind, and shards


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("merge", help="join the results of batch --shard, in the order of the queries")
    shards = "files of the shards, finished or not (those that lie beside RESULTS.json)"
    parser.add_argument("shards", type=Path, nargs="*", metavar="SHARD.json", help=shards)
    parser.add_argument("--out", type=Path, required=True, metavar="RESULTS.json", help="as the shards' --out was")
    parser.add_argument("--poses", type=Path, metavar="OUT.txt", help="also write lines of name qw qx qy qz tx ty tz")
    parser.add_argument("--exit-zero", action="store_true", help=EXIT_ZERO_HELP)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    shards = args.shards or find_shards(args.out)
    if not shards:
        raise UsageError(f"No shard lies beside '{args.out}'; give the files that batch --shard has written.")
    check_outputs({"--out": args.out, "--poses": args.poses}, {"a shard": shards})
    joined = join(shards)
    if args.poses is not None:
        _check_names(joined)
    for sentence in (*joined.damage, *joined.conflicts[:LISTED]):
        message(sentence)
    if len(joined.conflicts) > LISTED:
        message(f"... and {len(joined.conflicts) - LISTED} more.")
    if same := joined.double - len(joined.conflicts):
        message(f"{counted(same, 'photo')} {'is' if same == 1 else 'are'} in two shards, with the same answer.")
    _check_gain(args.out, joined)
    store = _written(args, joined)
    if args.poses is not None:
        write_poses(args.poses, store.records)
    code = say_endings(store.records, args.out)
    if joined.missing:
        _say_missing(joined)
    # What is missing no file tells, so the exit code does in any case.
    return Outcome(FAILED_VERDICT if joined.missing else OK if args.exit_zero else code)


def _check_gain(out: Path, joined: Joined) -> None:
    """Raises ResultsError where `out` holds more photos than all shards, as after a batch that did what was missing of them."""
    try:
        there = sum(sound and bool(frame["verdict"]) for frame, _, sound in StoredRecords(out)) if out.is_file() else 0
    except ValueError:  # no results, of which the store has its own sentence
        return
    if there > len(joined.records):
        raise ResultsError(
            f"'{out}' holds {counted(there, 'photo')}, and the shards only {len(joined.records)} of them; name another file "
            "with --out, or delete this one."
        )


def _check_names(joined: Joined) -> None:
    """Raises DatasetError where a pose list cannot hold a photo's name, before anything is written."""
    for record in joined.records.values():
        if record["R"] is not None and "error" not in record:
            checked(record["file"])


def _say_missing(joined: Joined) -> None:
    be, more = "is" if joined.missing == 1 else "are", len(joined.gaps) - LISTED
    gaps = "; ".join([*joined.gaps[:LISTED], *([f"and {counted(more, 'more shard')}"] if more > 0 else [])])
    message(f"{joined.missing} of {counted(joined.total, 'photo')} {be} missing: {gaps}.")


def _written(args: argparse.Namespace, joined: Joined) -> ResultStore:
    """The results file, with lenses shared as the shards' command had it."""
    photos = [joined.photos[index] for index in sorted(joined.records)]
    store = ResultStore(args.out, [photo.key for photo in photos])
    with store:
        for place, photo in enumerate(photos):
            store.put(place, {name: value for name, value in joined.records[photo.index].items() if name != "key"})
        if joined.shared_lens == "auto":
            _say_out_of_reach(store, [photo.file for photo in photos])
        share_lenses(joined.shared_lens, [BatchQuery(Unplaced(photo.name), photo.file) for photo in photos], store)
    return store


def _say_out_of_reach(store: ResultStore, files: list[Path]) -> None:
    """Photos tell by their EXIF whose lens they share, so they have to be there."""
    solved = [file for place, file in enumerate(files) if (gist := store.records.gist(place)) is not None and gist.shares]
    lacking = [file for file in solved if not file.is_file()]
    if lacking:
        message(
            f"{len(lacking)} of {counted(len(solved), 'photo')} cannot be read here, such as '{lacking[0]}', and share no "
            "lens; run merge where the photos are."
        )
