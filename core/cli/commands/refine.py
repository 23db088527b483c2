"""`refine SCENE PHOTO --camera CAM.json`: the exact camera of one photo."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

from ...batch.refine_one import read_masked_photo, refine_photo
from ...cameras.files import StartCamera, read_starts
from ...errors import CameraError, PhotoError
from ...geometry.camera import Camera
from ...photos.lens_guess import guess_lens
from ...photos.mask import find_mask
from ...photos.photo import Photo
from ...pose.report import RefineReport
from ...pose.report_json import report_to_dict
from ...render import ProcessRenderer, RenderSettings
from ...splats import read_splats
from ...support.atomic import atomic_write
from ..console import message, say
from ..dropped import say_dropped
from ..flags import MASK_HELP, SCENE_HELP, add_settings_flags, settings_from
from ..outcome import FAILED_VERDICT, OK, Outcome
from ..paths import check_outputs
from ..progress import ProgressBar


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("refine", help="find the exact camera of one photo from a rough start")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("photo", type=Path, help="the photograph (JPEG, PNG, TIFF, WebP)")
    parser.add_argument(
        "--camera", type=Path, required=True, metavar="CAM.json", help="the start: rough pose, and lens where known"
    )
    parser.add_argument("--mask", type=Path, metavar="FILE_OR_DIR", help=MASK_HELP)
    parser.add_argument("--out", type=Path, metavar="RESULT.json", help="where to write the result (stdout)")
    add_settings_flags(parser)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args)
    mask = None if args.mask is None else _mask(args.mask, args.photo)
    models = [Path(name) for name in (settings.model, settings.matcher_model) if name]
    inputs = {"the scan": args.scene, "the photo": args.photo, "the start": args.camera, "the mask": mask, "a model": models}
    check_outputs({"--out": args.out}, inputs)
    photo = read_masked_photo(args.photo, mask)
    for remark in photo.notes:
        message(remark)
    camera = start_camera(pick_start(args.camera, args.photo), photo)
    scene = read_splats(args.scene)
    say_dropped(scene)
    side_by_side = RenderSettings.for_scene(scene, settings.threads)
    with ProcessRenderer(scene, side_by_side) as renderer, ProgressBar("Refining") as bar:
        report = refine_photo(renderer, photo, camera, settings, lambda p: bar.show(p.fraction, p.step))
        bar.show(1.0, report.verdict)
    text = json.dumps(report_to_dict(report), indent=1)
    if args.out is None:
        say(text)
    else:
        _write(args.out, text)
        say(summary(report))
    code = FAILED_VERDICT if report.verdict == "failed" else OK
    return Outcome(code, args.scene, (report.camera,), (args.photo,), (report,), (mask,))


def _write(path: Path, text: str) -> None:
    try:
        with atomic_write(path) as file:
            file.write(text + "\n")
    except OSError:
        # The result is not lost.
        say(text)
        raise


def _mask(masks: Path, photo: Path) -> Path:
    """The photo's mask. Raises PhotoError when a folder has none for it."""
    found = find_mask(masks, photo)
    if found is None:
        raise PhotoError(
            f"The folder '{masks}' has no mask for '{photo.name}'; name it '{photo.name}.png' or '{photo.stem}.png'."
        )
    return found


def summary(report: RefineReport) -> str:
    """One line for people."""
    return f"{report.verdict} after {len(report.iterations)} iterations, {report.seconds:.1f} s. {' '.join(report.reasons)}"


def start_camera(start: StartCamera, photo: Photo) -> Camera:
    """The camera to start from, with the lens that the photo suggests where the file tells none, which is said then."""
    guess = guess_lens(photo)
    if start.intrinsics is None:
        message(f"The start tells no lens: {guess.assumption}.")
    return replace(start.camera(guess.intrinsics), file=photo.file)


def pick_start(file: Path, photo: Path) -> StartCamera:
    """The file's only camera, or the one that names the photo. Raises CameraError when that is nobody, or several."""
    starts = read_starts(file)
    if len(starts) == 1:
        return starts[0]
    named = [s for s in starts if Path(s.file).name == photo.name]
    if len(named) != 1:
        raise CameraError(
            f"'{file.name}' holds {len(starts)} cameras, {len(named)} of them for '{photo.name}'; "
            'give one camera, or one whose "file" names the photo.'
        )
    return named[0]
