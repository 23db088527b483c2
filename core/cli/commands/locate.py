"""`locate SCENE PHOTO`: the exact camera of one photo, without any start."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from ...batch.find_one import find_target, found_to_dict, whole_found
from ...batch.place import into_file
from ...batch.refine_one import read_masked_photo
from ...cameras.files import StartCamera
from ...cameras.unplaced import Unplaced
from ...photos.lens_guess import guess_lens
from ...photos.photo import Photo
from ...render import ProcessRenderer, RenderSettings
from ...splats import read_splats
from ..console import message
from ..dropped import say_dropped
from ..flags import CAMERAS_HELP, MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, settings_from
from ..maps import MapFlags, add_map_flags, check_results, find_with_progress
from ..outcome import FAILED_VERDICT, OK, Outcome, shown
from ..paths import check_outputs
from ..result import put_result
from .refine import mask_file, pick_wanted


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("locate", help="find the exact camera of one photo without a start")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("photo", type=Path, help="the photograph (JPEG, PNG, TIFF, WebP, AVIF, and those of docs/formats.md)")
    lens = f"the lens, where known (EXIF's, or a guess); {CAMERAS_HELP}"
    parser.add_argument("--camera", type=Path, metavar="CAMERAS", help=lens)
    parser.add_argument("--mask", type=Path, metavar="FILE_OR_DIR", help=MASK_HELP)
    parser.add_argument("--out", type=Path, metavar="RESULT.json", help="where to write the result (stdout)")
    add_axes_flag(parser)
    add_map_flags(parser)
    add_settings_flags(parser)
    parser.set_defaults(make_renderer=ProcessRenderer)  # a program that this runs in may have another
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args)
    mask = None if args.mask is None else mask_file(args.mask, args.photo)
    models = [Path(name) for name in (settings.model, settings.matcher_model) if name]
    inputs = {"the scan": args.scene, "the photo": args.photo, "the lens": args.camera, "the mask": mask}
    check_outputs(
        {"--out": args.out, "--map": args.map},
        {**inputs, "the known cameras": args.cameras, "a model": models},
    )
    check_results({"--out": args.out}, args.scene)
    flags = MapFlags(args, settings.threads)
    photo = read_masked_photo(args.photo, mask)
    for remark in photo.notes:
        message(remark)
    given = Unplaced() if args.camera is None else pick_wanted(args.camera, args.photo)
    known = given if isinstance(given, Unplaced) else Unplaced.of(given)
    wanted = replace(known, file=photo.file).with_guess(guess_lens(photo).intrinsics)
    target = find_target(photo, wanted)
    _say_lens(given, photo)
    scene = read_splats(args.scene)
    say_dropped(scene)
    with args.make_renderer(scene, RenderSettings.for_scene(scene, settings.threads)) as renderer:
        found = whole_found(photo, find_with_progress(renderer, target, flags.cache(scene), settings), wanted)
    put_result(args.out, into_file(found_to_dict(found, wanted), scene.origin))
    if found.camera is None or found.refined is None:
        return Outcome(FAILED_VERDICT, args.scene)
    camera, photo_file = shown(found.camera.relative_to([-value for value in scene.origin]), args.photo)
    return Outcome(OK, args.scene, (camera,), (photo_file,), (found.refined,), (mask if photo_file else None,))


def _say_lens(given: StartCamera | Unplaced, photo: Photo) -> None:
    """Tells what was assumed, and what was given for nothing."""
    if isinstance(given, StartCamera):
        message("The pose in the file of the lens is not used; `refine` begins at it.")
    if given.tells_no_lens:
        message(f"The lens is not known: {guess_lens(photo).assumption}.")
