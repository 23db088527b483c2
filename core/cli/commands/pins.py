"""`pins SCENE PHOTO --pins PINS.json`: the camera of one photo from pairs that somebody set by hand."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from ...batch.place import into_file
from ...cameras.unplaced import Unplaced
from ...photos.photo import read_photo
from ...pose.settings import RefineSettings
from ...render import Renderer, RenderSettings
from ...splats import read_splats
from ...support.options import options_of
from ..console import message
from ..dropped import say_dropped
from ..flags import CAMERAS_HELP, SCENE_HELP, add_axes_flag, whole_number
from ..outcome import OK, Outcome
from ..paths import check_outputs
from ..pinning import Pinning, pins_into_file, pins_to_dict
from ..result import put_result
from .refine import pick_wanted, wanted_camera

PINS_HELP = (
    'pairs: {"pins": [{"photo": [x, y], "world": [x, y, z]}, ...]}, or with "view": [x, y], a pixel of the scan drawn through '
    "the start camera, in place of the point"
)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("pins", help="place the camera of one photo by pairs that were set by hand")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("photo", type=Path, help="the photograph (JPEG, PNG, TIFF, WebP, AVIF, and those of docs/formats.md)")
    parser.add_argument("--pins", type=Path, metavar="PINS.json", required=True, help=PINS_HELP)
    start = "a camera near the photo's, and its lens where known; four pins and more need none"
    parser.add_argument("--camera", type=Path, metavar="CAMERAS", help=f"{start}; {CAMERAS_HELP}")
    lens = "auto: the focal length where it is a guess, from four pins on; fixed: nothing; focal: the focal length (auto)"
    parser.add_argument("--lens", choices=("auto", "fixed", "focal"), default="auto", help=f"what is solved for; {lens}")
    parser.add_argument("--out", type=Path, metavar="RESULT.json", help="where to write the result (stdout)")
    add_axes_flag(parser)
    threads = options_of(RefineSettings)["threads"].help
    parser.add_argument("--threads", type=whole_number, default=0, metavar="N", help=f"{threads} (0)")
    return parser


def run(args: argparse.Namespace) -> Outcome:
    inputs = {"the scan": args.scene, "the photo": args.photo, "the start": args.camera, "the pins": args.pins}
    check_outputs({"--out": args.out}, inputs)
    photo = read_photo(args.photo)
    for remark in photo.notes:
        message(remark)
    told = Unplaced() if args.camera is None else pick_wanted(args.camera, args.photo)
    wanted = wanted_camera(told, photo)
    scene = read_splats(args.scene)
    say_dropped(scene)
    renderer = Renderer(scene, RenderSettings.for_scene(scene, args.threads))
    report = Pinning(renderer, scene, args.axes).place(photo, wanted, args.pins, args.lens)
    report = replace(report, camera=replace(report.camera, file=photo.file))
    put_result(args.out, pins_into_file(into_file(pins_to_dict(report), scene.origin), scene.origin))
    return Outcome(OK)
