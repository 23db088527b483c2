"""`batch SCENE QUERIES.json --out RESULTS.json`: every photo of a list, over several processes, safe against interruption.

A 7-Scenes or Cambridge folder may stand for the list: `batch SCENE FOLDER --start POSES.txt --preset 7scenes --out ...`.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from ...batch.keys import BatchQuery, query_keys
from ...batch.queries import find_queries
from ...batch.store import ResultStore
from ...cameras import pose_list
from ...cameras.files import camera_from_dict, camera_to_dict
from ...errors import UsageError
from ...photos.mask import find_mask
from ...pose.presets import PRESETS
from ...pose.report_json import error_to_dict
from ...pose.settings import RefineSettings
from ...processes.pool import Pool
from ...splats import check_splat_file
from ..console import message, say
from ..flags import MASK_HELP, SCENE_HELP, add_settings_flags, settings_from
from ..outcome import FAILED_VERDICT, OK, Outcome
from ..paths import check_outputs
from ..progress import ProgressBar


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("batch", help="refine many photos; a second run goes on where the first one stopped")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    source = 'camera JSON: each camera is the start of its "file", relative to this JSON; or a 7-Scenes or Cambridge folder'
    parser.add_argument("queries", type=Path, metavar="SOURCE", help=source)
    parser.add_argument("--start", type=Path, metavar="POSES.txt", help="start poses of a folder's test photos (any pose file)")
    parser.add_argument("--focal", type=float, metavar="PX", help="focal length of a folder's photos (7-Scenes: 525)")
    parser.add_argument("--preset", choices=list(PRESETS), help="the paper's settings; the scan's unit must be the metre")
    parser.add_argument("--out", type=Path, required=True, metavar="RESULTS.json", help="results, in the order of the queries")
    parser.add_argument("--poses", type=Path, metavar="OUT.txt", help="also write lines of name qw qx qy qz tx ty tz")
    parser.add_argument("--mask", type=Path, metavar="FILE_OR_DIR", help=MASK_HELP)
    workers = os.cpu_count() or 1
    parser.add_argument("--workers", type=int, default=workers, metavar="N", help=f"processes, each holds the scan ({workers})")
    add_settings_flags(parser, skip=("threads",))
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args, PRESETS[args.preset] if args.preset else None)
    found = find_queries(args)
    for sentence in found.notes:
        message(sentence)
    masks = _mask_files(args.mask, found.photos)
    queries = [BatchQuery(*one) for one in zip(found.cameras, found.photos, masks, strict=True)]
    if args.workers < 1:
        raise UsageError(f"--workers is {args.workers}; give at least 1.")
    _check_paths(args, queries, settings)
    check_splat_file(args.scene)
    with ResultStore(args.out, query_keys(args.scene, queries, settings)) as store:
        if store.records:
            message(f"{len(store.records)} of {len(queries)} photos were finished before and are kept.")
        _work(args, queries, settings, store)
    verdicts = Counter(record["verdict"] for record in store.records.values())
    say(", ".join(f"{verdicts[v]} {v}" for v in ("trusted", "check", "failed")) + f"; results in {args.out}")
    results = tuple(camera_from_dict(store.records[i]) for i in range(len(queries)))
    if args.poses is not None:
        tried = [camera for i, camera in enumerate(results) if "error" not in store.records[i]]
        pose_list.write(args.poses, [(camera.file, camera.pose) for camera in tried])
    code = FAILED_VERDICT if verdicts["failed"] else OK
    return Outcome(code, args.scene, results, tuple(found.photos), masks=tuple(masks))


def _check_paths(args: argparse.Namespace, queries: Sequence[BatchQuery], settings: RefineSettings) -> None:
    """Raises UsageError when what is to be written would overwrite what is read."""
    inputs = {
        "the scan": args.scene,
        "the queries file itself": args.queries,
        "the start poses": args.start,
        "a photo": [query.photo for query in queries],
        "a mask": [query.mask for query in queries if query.mask],
        "a model": [Path(name) for name in (settings.model, settings.matcher_model) if name],
    }
    check_outputs({"--out": args.out, "--poses": args.poses}, inputs)


def _work(args: argparse.Namespace, queries: Sequence[BatchQuery], settings: RefineSettings, store: ResultStore) -> None:
    tasks = [
        (i, {"camera": camera_to_dict(q.camera), "photo": str(q.photo), "mask": str(q.mask) if q.mask else None})
        for i, q in enumerate(queries)
        if i not in store.records
    ]
    first = {"scene": str(args.scene.resolve()), "settings": {**asdict(settings), "threads": 1}}
    dropped, failed = 0, sum(record["verdict"] == "failed" for record in store.records.values())
    lost = lambda i, reason: error_to_dict(queries[i].camera, f"The worker process ended on this photo ({reason}).")  # noqa: E731
    with Pool(first, args.workers) as pool, ProgressBar("Refining") as bar:

        def show() -> None:
            bar.show(len(store.records) / len(queries), f"{len(store.records)} of {len(queries)}, {failed} failed")

        def started(left_out: int) -> None:
            nonlocal dropped
            dropped = left_out
            show()

        for index, record in pool.run(tasks, lost, started):
            store.put(index, record)
            failed += record["verdict"] == "failed"
            show()
    if dropped:
        message(f"Left out {dropped} Gaussians of the scan whose values are NaN or infinite.")


def _mask_files(masks: Path | None, photos: list[Path]) -> list[Path | None]:
    """Each photo's mask, None where it has none; says how many have one. Raises PhotoError when `masks` does not exist."""
    if masks is None:
        return [None] * len(photos)
    found = [find_mask(masks.resolve(), photo) for photo in photos]
    message(f"{sum(mask is not None for mask in found)} of {len(photos)} photos have a mask; the others are used whole.")
    return found
