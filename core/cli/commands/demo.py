"""`demo`: the whole job on the built-in sample, without a start; a picture shows the first guess and the end."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

from ...batch.find_one import find_target, found_to_dict
from ...cameras.files import read_cameras
from ...cameras.unplaced import Unplaced
from ...errors import UsageError
from ...geometry.camera import pose_error
from ...locate import FindReport, MapCache, MapPlace, MapSettings
from ...photos.photo import read_photo
from ...pictures.chessboard import before_after, save_png
from ...render import ProcessRenderer, RenderSettings
from ...splats import read_splats
from ...support.words import counted
from ...synthetic import SampleFiles, write_sample
from ..console import say
from ..flags import add_settings_flags, settings_from
from ..maps import find_with_progress
from ..outcome import FAILED_VERDICT, OK, Outcome

RESULT, PICTURE, TRUTH = "result.json", "before_after.png", "truth.json"
WRITTEN = ("room.ply", "photo.jpg", "start.json", TRUTH, RESULT, PICTURE)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("demo", help="build the sample scene and find the camera of a photo of it")
    parser.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="where everything is written (demo)")
    add_settings_flags(parser)
    parser.set_defaults(make_renderer=ProcessRenderer)  # a program that this runs in may have another
    return parser


def run(args: argparse.Namespace) -> Outcome:
    _check_folder(args.out)
    settings = settings_from(args)
    sample = write_sample(args.out)
    scene, photo = read_splats(sample.scene), read_photo(sample.photo)
    lens = Unplaced.of(replace(read_cameras(sample.start)[0], file=str(sample.photo)))  # its pose is for who wants to try it
    cache = MapCache(scene, MapPlace(sample.scene), MapSettings(threads=settings.threads))
    with args.make_renderer(scene, RenderSettings.for_scene(scene, settings.threads)) as renderer:
        found = find_with_progress(renderer, find_target(photo, lens), cache, settings)
        if found.refined is not None:
            picture = before_after(renderer, photo, found.refined.start, found.refined.camera)
            save_png(str(args.out / PICTURE), picture)
    (args.out / RESULT).write_text(json.dumps(found_to_dict(found, lens), indent=1) + "\n")
    say(f"{counted(len(scene), 'Gaussian')}, photo {photo.width} x {photo.height}; files are in {args.out}")
    say(errors(sample, found))
    if found.camera is None or found.refined is None:
        return Outcome(FAILED_VERDICT, sample.scene)
    return Outcome(OK, sample.scene, (found.camera,), (sample.photo,), (found.refined,))


def _check_folder(folder: Path) -> None:
    """Raises UsageError when the folder has files of the demo's names that no earlier demo wrote."""
    taken = [name for name in WRITTEN if (folder / name).exists()]
    if taken and TRUTH not in taken:
        raise UsageError(f"'{folder}' has the file '{taken[0]}', which no demo wrote; give another folder with --out DIR.")


def errors(sample: SampleFiles, found: FindReport) -> str:
    """Errors against the sample's truth of what the map said and of the refined camera, and the verdict, for people."""
    truth = read_cameras(sample.truth)[0].pose
    verdict = f"verdict: {found.verdict}. {' '.join(found.reasons)}"
    if found.refined is None:
        return verdict
    before, after = (pose_error(camera.pose, truth) for camera in (found.refined.start, found.refined.camera))
    return (
        f"found without a start, in {counted(found.views, 'view')} of the scan: {1000 * before[0]:.1f} mm, "
        f"{before[1]:.2f} deg off (the room is 5 m deep)\n"
        f"refined: {1000 * after[0]:.2f} mm, {after[1]:.3f} deg off, {found.seconds:.1f} s\n{verdict}"
    )
