"""`batch SCENE QUERIES.json --out RESULTS.json`: every photo of a list, over several processes, safe against interruption.

A 7-Scenes or Cambridge folder may stand for the list: `batch SCENE FOLDER [--start POSES.txt] --preset 7scenes --out ...`.
Photos without a start, and those whose refinement from it fails, are searched for.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...batch.keys import BatchQuery, query_keys, scan_file_digest
from ...batch.lens_groups import SHARING
from ...batch.queries import find_queries
from ...batch.store import ResultStore
from ...cameras import pose_list, short
from ...cameras.files import camera_from_dict
from ...cameras.training_world import AXES, TAKEN
from ...errors import UsageError
from ...photos.mask import find_mask
from ...pose.presets import PRESETS
from ...pose.settings import RefineSettings
from ...splats import check_splat_file
from ...support.words import counted
from ..console import message, say
from ..flags import MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, number, settings_from, whole_number
from ..maps import MapFlags, add_map_flags, check_results
from ..outcome import FAILED_VERDICT, INTERRUPTED, OK, Outcome, has_camera, shown
from ..paths import check_outputs
from ..rounds import TO_FIND, Rounds
from ..sharing import SHARED_LENS_HELP, share_lenses

UNUSABLE = "not usable"  # of a photo that could not be tried at all
ENDINGS = ("trusted", "check", "failed", UNUSABLE)
LISTED = 10  # photos that are named when a batch ends

Record = dict[str, Any]


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
    parser.add_argument("--shared-lens", choices=SHARING, default="auto", help=SHARED_LENS_HELP)
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
    if args.workers < 1:
        raise UsageError(f"--workers is {args.workers}; give at least 1.")
    _check_paths(args, queries, settings)
    check_splat_file(args.scene)
    digest = scan_file_digest(args.scene)
    store = ResultStore(args.out, query_keys(args.scene, queries, settings, _word(args, flags)))
    try:
        with store:
            kept = _finished(store)
            if kept:
                be = "was finished before and is" if kept == 1 else "were finished before and are"
                message(f"{kept} of {counted(len(queries), 'photo')} {be} kept.")
            searching = flags if args.locate else None
            Rounds(args.scene, args.workers, settings, searching, digest, args.axes).run(queries, store)
            share_lenses(args.shared_lens, queries, store)
    except KeyboardInterrupt:
        done = f"{_finished(store)} of {counted(len(queries), 'photo')}"
        message(f"Interrupted; {done} finished, in '{args.out}'. The same command goes on with the others.")
        return Outcome(INTERRUPTED)
    records = [store.records[i] for i in range(len(queries))]
    _say_lost(records, args.out)
    counts = Counter(_ending(record) for record in records)
    endings = [ending for ending in ENDINGS if ending != UNUSABLE or counts[ending]]
    say(", ".join(f"{counts[ending]} {ending}" for ending in endings) + f"; results in {args.out}")
    code = FAILED_VERDICT if counts["failed"] or counts[UNUSABLE] else OK
    return _outcome(args, code, queries, records)


def _word(args: argparse.Namespace, flags: MapFlags) -> str:
    """What besides the settings the answers depend on."""
    return f"{flags.word if args.locate else ''}{'' if args.axes == AXES[0] else args.axes}"


def _finished(store: ResultStore) -> int:
    return sum(TO_FIND not in record for record in store.records.values())


def _ending(record: Record) -> str:
    """One of ENDINGS."""
    return UNUSABLE if "error" in record else str(record["verdict"])


def _say_lost(records: Sequence[Record], out: Path) -> None:
    """Tells which photos failed or could not be used, and why; of many the first."""
    lost = [record for record in records if _ending(record) in ("failed", UNUSABLE)]
    for record in lost[:LISTED]:
        ending = "failed" if "error" not in record else "could not be used"
        name = f"'{short(record['file'])}' {ending}: " if record["file"] else ""
        message(f"{name}{' '.join(record['reasons'][0].split())}")
    if len(lost) > LISTED:
        message(f"... and {len(lost) - LISTED} more in '{out}'.")
    told = Counter(reason for record in records for reason in record["reasons"] if reason.startswith(TAKEN))
    for sentence, count in told.items():
        message(sentence if count == 1 else f"In {count} of {counted(len(records), 'photo')}: {sentence}")
    nowhere = sum(record["R"] is None and "error" not in record for record in records)
    if nowhere:
        be, have = ("was", "it has") if nowhere == 1 else ("were", "they have")
        message(f"{nowhere} of {counted(len(records), 'photo')} had no start and {be} not found, so {have} no pose.")


def _outcome(args: argparse.Namespace, code: int, queries: Sequence[BatchQuery], records: Sequence[Record]) -> Outcome:
    """The outcome, of the photos that have a camera; the poses are written where they are asked for."""
    placed = [i for i, record in enumerate(records) if has_camera(record)]
    cameras = tuple(camera_from_dict(records[i]) for i in placed)
    if args.poses is not None:
        tried = [camera for i, camera in zip(placed, cameras, strict=True) if "error" not in records[i]]
        pose_list.write(args.poses, [(camera.file, camera.pose) for camera in tried])
    found = [shown(camera, queries[i].photo) for i, camera in zip(placed, cameras, strict=True)]
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
