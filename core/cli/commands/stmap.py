"""`stmap CAMERAS OUTDIR`: the lenses of cameras as ST maps, for programs that undistort and distort pictures by them."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...cameras import starts
from ...cameras.files import StartCamera
from ...errors import CameraError
from ...geometry.camera import Intrinsics
from ...geometry.wide_lens import WideLens
from ...pictures.stmap import distort_map, straight_lens, undistort_map, write_stmap
from ...support.words import counted
from ..console import message, say
from ..flags import CAMERAS_HELP
from ..outcome import OK, Outcome
from ..paths import check_outputs
from .render import output_names

UNDISTORT, DISTORT = "_undistort.exr", "_distort.exr"
CONVENTION = "red is s, to the right, green is t, up; the centre of pixel i of w has s = (i + 0.5) / w, as in Nuke"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        "stmap", help="write the lens of each camera as ST maps (EXR), to undistort and to distort with"
    )
    parser.add_argument("cameras", type=Path, help=f"{CAMERAS_HELP}; a result of refine is one")
    parser.add_argument("outdir", type=Path, help="folder for the maps, made where it is missing")
    return parser


def run(args: argparse.Namespace) -> Outcome:
    found = starts(args.cameras)
    for note in found.notes:
        message(note)
    lenses: dict[Intrinsics | WideLens, list[StartCamera]] = {}
    for start in found.placed:
        lens = start.intrinsics or start.wide
        if lens is None or (isinstance(lens, WideLens) and lens.is_panorama):
            what = "is a panorama" if lens else "has no lens of a known size"
            message(f"The camera of '{start.file}' {what}, and no map is written for it.")
        else:
            lenses.setdefault(lens, []).append(start)
    if not lenses:
        raise CameraError(
            f"No camera in '{args.cameras.name}' has a lens that a map can be made of; give width, height, fx and fy."
        )
    names = output_names([some[0].known_camera() for some in lenses.values()], args.cameras.stem)
    outputs = {f"The map {name}{end}": args.outdir / (name + end) for name in names for end in (UNDISTORT, DISTORT)}
    check_outputs(outputs, {"the cameras": args.cameras})
    args.outdir.mkdir(parents=True, exist_ok=True)
    for (lens, some), name in zip(lenses.items(), names, strict=True):
        write_stmap(args.outdir / (name + UNDISTORT), undistort_map(lens))
        write_stmap(args.outdir / (name + DISTORT), distort_map(lens))
        k = straight_lens(lens)
        say(
            f"'{name}{UNDISTORT}' and '{name}{DISTORT}' ({counted(len(some), 'camera')}): the undistorted picture has "
            f"{k.width} x {k.height} pixels, fx {k.fx:.6g}, fy {k.fy:.6g}, centre {k.cx:.6g} {k.cy:.6g}."
        )
    say(f"In the maps, {CONVENTION}.")
    return Outcome(OK)
