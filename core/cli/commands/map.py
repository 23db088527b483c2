"""`map SCENE`: the views of the scan in which photos are found without a start; made once, and kept."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from ...errors import GssmcError
from ...locate import LandmarkMap, MapCache
from ...splats import read_splats
from ...support.words import counted
from ..console import message, say
from ..dropped import say_dropped
from ..flags import SCENE_HELP, add_axes_flag, whole_number
from ..maps import MapFlags, add_map_flags
from ..outcome import INTERRUPTED, OK, Outcome
from ..paths import check_outputs
from ..progress import ProgressBar


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("map", help="make the map of a scan, by which photos are found without a start")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    add_axes_flag(parser)
    add_map_flags(parser)
    threads_help = "threads that draw a view, 0 = one per core (0)"
    parser.add_argument("--threads", type=whole_number, default=0, metavar="N", help=threads_help)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    check_outputs({"--map": args.map}, {"the scan": args.scene, "the known cameras": args.cameras})
    flags = MapFlags(args, args.threads)
    flags.check_writable()
    scene = read_splats(args.scene)
    say_dropped(scene)
    cache = flags.cache(scene)
    made = LandmarkMap(cache.key)
    interrupted = False
    try:
        with ProgressBar("Mapping") as bar, closing(cache.steps()) as steps:  # type: ignore[type-var]
            for step in steps:
                made = step.map
                bar.show(step.fraction, f"{step.step}, {counted(len(made), 'view')}")
    except KeyboardInterrupt:
        interrupted = True
    return _end(cache, made, interrupted)


def _end(cache: MapCache, made: LandmarkMap, interrupted: bool) -> Outcome:
    """Says what there is. Raises GssmcError when the map could not be written."""
    file = cache.stored_in()
    if interrupted:
        if file is None:
            message("Interrupted before the map had a view; nothing was written.")
        else:
            views = counted(len(cache.read()), "view")
            message(f"Interrupted; the map in '{file}' has {views} and can be used, and continued.")
        return Outcome(INTERRUPTED)
    if file is None:
        raise GssmcError("The map was made and could not be kept; make room, or give another file with --map.")
    known = [view for view in made.views if view.known]
    blind = sum(len(view) == 0 for view in known)
    if blind:
        see = f"{blind} of {counted(len(known), 'known camera')} {'sees' if blind == 1 else 'see'} nothing of the scan"
        message(f"{see}; the file may belong to another world or scan.")
    if not made.views:
        message("No view of the scan shows anything to be found by.")
    of_known = f", {len(known)} of them from known cameras" if known else ""
    say(f"{counted(len(made), 'view')}{of_known}, {counted(made.landmarks, 'landmark')}; the map is in {file}")
    return Outcome(OK)
