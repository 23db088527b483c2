"""`demo`: the whole job on the built-in sample, with a picture of the camera before and after."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

from ...batch.refine_one import refine_photo
from ...cameras.files import read_cameras
from ...errors import UsageError
from ...geometry.camera import Camera, pose_error
from ...photos.photo import read_photo
from ...pictures.chessboard import before_after, save_png
from ...pose.report import RefineReport
from ...pose.report_json import report_to_dict
from ...render import ProcessRenderer, RenderSettings
from ...splats import read_splats
from ...synthetic import SampleFiles, write_sample
from ..console import say
from ..flags import add_settings_flags, settings_from
from ..outcome import FAILED_VERDICT, OK, Outcome
from ..progress import ProgressBar

RESULT, PICTURE, TRUTH = "result.json", "before_after.png", "truth.json"
WRITTEN = ("room.ply", "photo.jpg", "start.json", TRUTH, RESULT, PICTURE)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("demo", help="build the sample scene and refine a photo of it")
    parser.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="where everything is written (demo)")
    add_settings_flags(parser)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    _check_folder(args.out)
    sample = write_sample(args.out)
    scene, photo = read_splats(sample.scene), read_photo(sample.photo)
    start = replace(read_cameras(sample.start)[0], file=str(sample.photo))
    settings = settings_from(args)
    with ProcessRenderer(scene, RenderSettings.for_scene(scene, settings.threads)) as renderer:
        with ProgressBar("Refining") as bar:
            report = refine_photo(renderer, photo, start, settings, lambda p: bar.show(p.fraction, p.step))
            bar.show(1.0, report.verdict)
        picture = before_after(renderer, photo, start, report.camera)
    (args.out / RESULT).write_text(json.dumps(report_to_dict(report), indent=1) + "\n")
    save_png(str(args.out / PICTURE), picture)
    say(f"{len(scene)} Gaussians, photo {photo.width} x {photo.height}; files are in {args.out}")
    say(errors(sample, start, report))
    return Outcome(
        FAILED_VERDICT if report.verdict == "failed" else OK, sample.scene, (report.camera,), (sample.photo,), (report,)
    )


def _check_folder(folder: Path) -> None:
    """Raises UsageError when the folder has files of the demo's names that no earlier demo wrote."""
    taken = [name for name in WRITTEN if (folder / name).exists()]
    if taken and TRUTH not in taken:
        raise UsageError(f"'{folder}' has a {taken[0]} that is no demo's; give another folder with --out DIR.")


def errors(sample: SampleFiles, start: Camera, report: RefineReport) -> str:
    """Errors against the sample's truth before and after, and the verdict, for people."""
    truth = read_cameras(sample.truth)[0].pose
    before, after = (pose_error(camera.pose, truth) for camera in (start, report.camera))
    return (
        f"before: {1000 * before[0]:.1f} mm, {before[1]:.2f} deg off (the room is 5 m deep)\n"
        f"after:  {1000 * after[0]:.2f} mm, {after[1]:.3f} deg off, {report.seconds:.1f} s\n"
        f"verdict: {report.verdict}. {' '.join(report.reasons)}"
    )
