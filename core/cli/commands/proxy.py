"""`proxy SCENE CAMERAS... --out PROXY.ply`: a mesh of what the cameras see of the scan."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ...cameras import starts
from ...cameras.training_world import ScanAxes
from ...errors import CameraError, UsageError
from ...geometry.camera import Camera
from ...proxy import ProxySettings, ProxyStep, iterate_proxy
from ...proxy.file import WRITERS, write_proxy, writer_of
from ...splats import read_splats
from ...support.options import options_of
from ...support.steps import run_to_end
from ...support.words import counted
from ..console import message, say
from ..dropped import say_dropped
from ..flags import CAMERAS_HELP, SCENE_HELP, add_axes_flag, number, whole_number
from ..outcome import OK, Outcome
from ..paths import check_outputs
from ..progress import ProgressBar

OPTIONS = options_of(ProxySettings)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        "proxy", help="make a mesh of what cameras see of the splat: to cast shadows on, to collide with"
    )
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("cameras", type=Path, nargs="+", help=CAMERAS_HELP)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help=f"the mesh: {', '.join(WRITERS)}")
    for name, flag in (("faces", "--faces"), ("long_side_px", "--long-side-px"), ("threads", "--threads")):
        default = getattr(ProxySettings, name)
        text = f"{OPTIONS[name].help} ({default})"
        parser.add_argument(flag, type=whole_number, default=default, metavar="N", help=text)
    text = f"{OPTIONS['smooth_px'].help} ({ProxySettings.smooth_px:g})"
    parser.add_argument("--smooth-px", type=number, default=ProxySettings.smooth_px, metavar="N", help=text)
    parser.add_argument("--close-holes", action="store_true", help=OPTIONS["close_holes"].help)
    parser.add_argument("--every", type=whole_number, default=1, metavar="N", help="take every Nth camera (1)")
    add_axes_flag(parser)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = ProxySettings(args.faces, args.close_holes, args.long_side_px, args.smooth_px, args.threads)
    writer_of(args.out)
    if args.every < 1:
        raise UsageError(f"--every is {args.every}; give 1 or more.")
    cameras = [camera for path in args.cameras for camera in _cameras(path)][:: args.every]
    photos = [args.cameras[0].resolve().parent / camera.file for camera in cameras if camera.file]
    check_outputs({"--out": args.out}, {"the scan": args.scene, "the cameras": args.cameras, "a photo": photos})
    scene = read_splats(args.scene)
    say_dropped(scene)
    cameras, sentence = ScanAxes.of(scene).settled(cameras, args.axes)
    if sentence:
        message(sentence)
    near = [camera.relative_to(scene.origin) for camera in cameras]
    with ProgressBar("Proxy") as bar:

        def show(step: ProxyStep) -> None:
            bar.show(step.fraction, f"{step.step}, {step.view} of {step.views}" if step.view else step.step)

        mesh = run_to_end(iterate_proxy(scene, near, settings), show)
    write_proxy(args.out, replace(mesh, vertices=mesh.vertices + scene.origin))
    views = counted(len(cameras), "camera")
    say(f"{counted(len(mesh.faces), 'triangle')} from {views}; the mesh is in {args.out}")
    return Outcome(OK)


def _cameras(path: Path) -> Sequence[Camera]:
    """The cameras of a file that have a lens, or a pinhole in the middle of a wider one, without those that failed; what
    is left out or in doubt is said. Raises CameraError where none is left.
    """
    found = starts(path)
    for note in found.notes:
        message(note)
    lensed = [start for start in found.placed if start.intrinsics is not None or start.wide is not None]
    if not lensed:
        raise CameraError(f"No camera of '{path.name}' has a place and a lens of a known size; give width, height, fx and fy.")
    if len(lensed) < found.count:
        message(f"Left out of '{path.name}': {found.count - len(lensed)} of {counted(found.count, 'camera')}, which lack one.")
    held = [start for start in lensed if start.verdict != "failed"]
    if not held:
        raise CameraError(f"Every camera of '{path.name}' failed, so that none shows the place; refine the photos first.")
    if len(held) < len(lensed):
        message(f"Left out of '{path.name}': {len(lensed) - len(held)} of {counted(len(lensed), 'camera')}, which failed.")
    doubted = sum(start.verdict == "check" for start in held)
    if doubted:
        message(f"Of '{path.name}', {counted(doubted, 'camera')} should be checked by eye; a wrong one bends the mesh.")
    return [start.known_camera() for start in held]
