"""`batch SCENE QUERIES.json --out RESULTS.json`: every photo of a list, over several processes, safe against interruption.

A 7-Scenes or Cambridge folder may stand for the list: `batch SCENE FOLDER [--start POSES.txt] --preset 7scenes --out ...`.
Photos without a start, and those whose refinement from it fails, are searched for.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from ...batch.executors import EXECUTORS, Executor
from ...batch.farm.shards import Shard, own_head, shard_head
from ...batch.keys import BatchQuery, query_keys, scan_file_digest
from ...batch.lens_groups import SHARING
from ...batch.queries import find_queries
from ...batch.records import LATER, KeptRecords
from ...batch.store import ResultStore
from ...cameras.files import camera_from_dict
from ...cameras.training_world import AXES
from ...errors import UsageError
from ...photos.mask import find_mask
from ...pose.presets import PRESETS
from ...pose.settings import RefineSettings
from ...splats import check_splat_file
from ...support.atomic import part_of
from ...support.words import counted
from ..console import message
from ..flags import MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, number, settings_from, whole_number
from ..maps import MapFlags, add_map_flags, check_results
from ..outcome import INTERRUPTED, OK, Outcome, has_camera, shown
from ..paths import check_outputs
from ..result import EXIT_ZERO_HELP, say_endings, write_poses
from ..rounds import Rounds
from ..sharing import SHARED_LENS_HELP, share_lenses

EXECUTOR_HELP = (
    "local: processes of this machine, dask: the workers of a Dask cluster, which read scan and photos by the same paths "
    f"({EXECUTORS[0]})"
)
SHARD_HELP = (
    "only every N-th photo, from the I-th on, into RESULTS.shard-I-of-N.json; N machines do all of them, and merge joins the "
    "files"
)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("batch", help="refine many photos; a second run goes on where the first one stopped")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    source = "camera JSON: each record is the start of its 'file' (relative to this JSON), or a name; or a data set's folder"
    parser.add_argument("queries", type=Path, metavar="SOURCE", help=source)
    parser.add_argument("--start", type=Path, metavar="POSES.txt", help="start poses of a folder's test photos (any pose file)")
    parser.add_argument("--focal", type=number, metavar="PX", help="focal length of a folder's photos (7-Scenes: 525)")
    parser.add_argument("--preset", choices=list(PRESETS), help="the paper's settings; the scan's unit must be the metre")
    parser.add_argument("--out", type=Path, required=True, metavar="RESULTS.json", help="results, in the order of the queries")
    parser.add_argument("--poses", type=Path, metavar="OUT.txt", help="also write lines of name qw qx qy qz tx ty tz")
    parser.add_argument("--mask", type=Path, metavar="FILE_OR_DIR", help=MASK_HELP)
    workers = os.cpu_count() or 1
    workers_help = f"processes, each holds the scan ({workers})"
    parser.add_argument("--workers", type=whole_number, default=workers, metavar="N", help=workers_help)
    parser.add_argument("--executor", choices=EXECUTORS, default=EXECUTORS[0], help=EXECUTOR_HELP)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask scheduler, such as tcp://host:8786 (one is started here)"
    )
    parser.add_argument("--shared-lens", choices=SHARING, default="auto", help=SHARED_LENS_HELP)
    parser.add_argument("--shard", metavar="I/N", help=SHARD_HELP)
    parser.add_argument("--exit-zero", action="store_true", help=EXIT_ZERO_HELP)
    add_axes_flag(parser)
    add_map_flags(parser, switch=True)
    add_settings_flags(parser, skip=("threads",))
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args, PRESETS[args.preset] if args.preset else None)
    flags = MapFlags(args)
    found = find_queries(args)
    for sentence in found.notes:
        message(sentence)
    masks = _mask_files(args.mask, found.photos)
    queries = [BatchQuery(*one) for one in zip(found.cameras, found.photos, masks, strict=True)]
    executor = _executor(args)
    shard = None if args.shard is None else Shard.parse(args.shard)
    if shard is not None:
        args.out = shard.file(args.out)
    _check_paths(args, queries, settings)
    check_splat_file(args.scene)
    digest, searching = scan_file_digest(args.scene, dated=False), flags if args.locate else None
    rounds = Rounds(args.scene, executor, settings, searching, digest, args.axes, part_of(args.out))
    queries, store = _store(args, queries, settings, _word(args, flags))
    try:
        with store:
            kept = _finished(store)
            if kept:
                be = "was finished before and is" if kept == 1 else "were finished before and are"
                message(f"{kept} of {counted(len(queries), 'photo')} {be} kept.")
            rounds.run(queries, store)
            if args.shard is None:
                share_lenses(args.shared_lens, queries, store)
    except KeyboardInterrupt:
        done = f"{_finished(store)} of {counted(len(queries), 'photo')}"
        message(f"Interrupted; {done} finished, in '{args.out}'. The same command goes on with the others.")
        return Outcome(INTERRUPTED)
    code = say_endings(store.records, args.out)
    return _outcome(args, OK if args.exit_zero else code, queries, store.records)


def _executor(args: argparse.Namespace) -> Executor:
    """Where the photos are done. Raises UsageError, also where the shard is asked for what it cannot give."""
    if args.workers < 1:
        raise UsageError(f"--workers is {args.workers}; give at least 1.")
    if args.shard is not None and args.poses is not None:
        raise UsageError("--poses is of all photos, and --shard does some of them; give --poses to merge.")
    executor = Executor(args.workers, args.executor, args.scheduler)
    executor.check()
    return executor


def _store(
    args: argparse.Namespace, queries: list[BatchQuery], settings: RefineSettings, word: str
) -> tuple[list[BatchQuery], ResultStore]:
    """The queries that are done here, and where their results go."""
    if args.shard is None:
        return queries, ResultStore(args.out, query_keys(args.scene, queries, settings, word))
    shard = Shard.parse(args.shard)
    own = [queries[i] for i in shard.of(len(queries))]
    message(f"{str(shard).capitalize()}: {len(own)} of {counted(len(queries), 'photo')}.")
    keys = query_keys(args.scene, own, settings, word)
    shared = {**shard_head(args.scene, queries, settings, word), "shared_lens": args.shared_lens}
    return own, ResultStore(args.out, keys, own_head(shared, shard, own, keys))


def _word(args: argparse.Namespace, flags: MapFlags) -> str:
    """What besides the settings the answers depend on."""
    return f"{flags.word if args.locate else ''}{'' if args.axes == AXES[0] else args.axes}"


def _finished(store: ResultStore) -> int:
    return len(store.records) - store.records.endings[LATER]


def _outcome(args: argparse.Namespace, code: int, queries: Sequence[BatchQuery], records: KeptRecords) -> Outcome:
    """The outcome, of the photos that have a camera; the poses are written where they are asked for. Of thousands of photos,
    no camera is made that nobody asks for.
    """
    if args.poses is not None:
        write_poses(args.poses, records)
    if not args.outcome_used:
        return Outcome(code, args.scene)
    placed = {i: camera_from_dict(record) for i in sorted(records) if has_camera(record := records[i])}
    found = [shown(camera, queries[i].photo) for i, camera in placed.items()]
    masks = tuple(queries[i].mask if photo else None for i, (_, photo) in zip(placed, found, strict=True))
    return Outcome(code, args.scene, tuple(one[0] for one in found), tuple(one[1] for one in found), masks=masks)


def _check_paths(args: argparse.Namespace, queries: Sequence[BatchQuery], settings: RefineSettings) -> None:
    """Raises UsageError when what is to be written would overwrite what is read."""
    inputs = {
        "the scan": args.scene,
        "the queries file itself": args.queries,
        "the start poses": args.start,
        "a photo": [query.photo for query in queries],
        "a mask": [query.mask for query in queries if query.mask],
        "a model": [Path(name) for name in (settings.model, settings.matcher_model) if name],
        "the known cameras": args.cameras,
    }
    check_outputs({"--out": args.out, "--poses": args.poses, "--map": args.map}, inputs)
    check_results({"--out": args.out, "--poses": args.poses}, args.scene)


def _mask_files(masks: Path | None, photos: list[Path]) -> list[Path | None]:
    """Each photo's mask, None where it has none; says how many have one. Raises PhotoError when `masks` does not exist."""
    if masks is None:
        return [None] * len(photos)
    found = [find_mask(masks.resolve(), photo) for photo in photos]
    have = sum(mask is not None for mask in found)
    message(f"{have} of {counted(len(photos), 'photo')} {'has' if have == 1 else 'have'} a mask; the others are used whole.")
    return found
