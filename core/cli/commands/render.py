"""`render SCENE CAMERAS.json OUTDIR`: draw the splat from every camera of a file."""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ...cameras import starts
from ...cameras.training_world import ScanAxes
from ...errors import CameraError, UsageError
from ...geometry.camera import Camera
from ...render import RenderedView, Renderer, RenderSettings
from ...splats import read_splats
from ...support.atomic import atomic_write
from ...support.picture_names import stem_of
from ...support.words import counted
from ..console import message, say
from ..dropped import say_dropped
from ..flags import CAMERAS_HELP, SCENE_HELP, add_axes_flag, number, whole_number
from ..outcome import OK, Outcome
from ..paths import check_outputs


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("render", help="draw the splat from every camera of a file, as a pinhole (no lens distortion)")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("cameras", type=Path, help=CAMERAS_HELP)
    parser.add_argument("outdir", type=Path, help="folder for the pictures, made where it is missing")
    parser.add_argument("--npz", action="store_true", help="write float arrays color, depth, alpha beside each picture")
    parser.add_argument(
        "--repeat", type=whole_number, default=0, metavar="N", help="draw N times, print the median ms per frame as JSON"
    )
    parser.add_argument("--threads", type=whole_number, default=0, metavar="N", help="CPU threads, 0 = all cores (0)")
    near = "near plane in scene units (as a refinement has it: 0.2, or nearer in a small scan)"
    parser.add_argument("--near", type=number, metavar="D", help=near)
    add_axes_flag(parser)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    if args.near is not None and not 0 < args.near < math.inf:
        raise UsageError(f"--near is {args.near:g}; give a distance above 0 in scene units.")
    cameras = _cameras(args.cameras)
    names = output_names(cameras, args.cameras.stem)
    _check_paths(args, cameras, names)
    scene = read_splats(args.scene)
    say_dropped(scene)
    cameras, sentence = ScanAxes.of(scene).settled(cameras, args.axes)
    if sentence:
        message(sentence)
    renderer = Renderer(scene, RenderSettings.for_scene(scene, max(0, args.threads), args.near))
    args.outdir.mkdir(parents=True, exist_ok=True)
    milliseconds: list[float] = []
    for camera, name in zip(cameras, names, strict=True):
        near = camera.relative_to(scene.origin)
        view = renderer.render(near.intrinsics, near.pose)
        write_view(args.outdir / name, view, args.npz)
        milliseconds += _time(renderer, near, args.repeat)
    if milliseconds:
        median = round(statistics.median(milliseconds), 3)
        say(json.dumps({"median_ms": median, "frames": len(cameras), "repeat": args.repeat, "gaussians": len(scene)}))
    return Outcome(OK, args.scene, tuple(cameras))


def _cameras(path: Path) -> list[Camera]:
    """The cameras of a file of any layout; what is left out is said. Raises CameraError where none has a lens."""
    found = starts(path)
    for note in found.notes:
        message(note)
    without = [at for at, start in enumerate(found.placed, 1) if start.intrinsics is None and start.wide is None]
    if without:
        sentence = f"Camera {without[0]} of '{path.name}' has no lens of a known size; give width, height, fx and fy."
        if len(without) == len(found.placed):
            raise CameraError(sentence)
        message(f"Left out: {len(without)} of {counted(len(found.placed), 'camera')}. {sentence}")
    wide = sum(start.wide is not None for start in found.placed)
    if wide:
        message(f"The middle of the view is drawn, as a pinhole, for {counted(wide, 'camera')} with a wider lens.")
    return [start.known_camera() for start in found.placed if start.intrinsics is not None or start.wide is not None]


def _check_paths(args: argparse.Namespace, cameras: Sequence[Camera], names: Sequence[str]) -> None:
    """Raises UsageError when a picture would overwrite the photo of a camera, or another file that is read."""
    photos = [args.cameras.resolve().parent / camera.file for camera in cameras if camera.file]
    suffixes = (".png", ".npz") if args.npz else (".png",)
    outputs = {f"The picture {name}{suffix}": args.outdir / (name + suffix) for name in names for suffix in suffixes}
    check_outputs(outputs, {"the scan": args.scene, "the cameras": args.cameras, "a photo": photos})


def output_names(cameras: Sequence[Camera], fallback: str) -> list[str]:
    """The stem of each camera's file, made unique by a number where two share it; `fallback` where it has none."""
    names: list[str] = []
    numbers: dict[str, int] = {}  # per stem, the last that was given; systems differ in whether A.png is a.png
    taken: set[str] = set()
    for camera in cameras:
        stem = stem_of(camera.file) or fallback
        name = stem
        while name.casefold() in taken:
            numbers[stem] = numbers.get(stem, 1) + 1
            name = f"{stem}_{numbers[stem]}"
        taken.add(name.casefold())
        names.append(name)
    return names


def write_view(path: Path, view: RenderedView, npz: bool) -> None:
    """`path`.png, and `path`.npz when asked."""
    write_png(path.with_name(path.name + ".png"), view.color)
    if npz:
        with atomic_write(path.with_name(path.name + ".npz"), "wb", one_of_many=True) as file:
            np.savez(file, color=view.color, depth=view.depth, alpha=view.alpha)


def write_png(path: Path, color: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> None:
    """Display-encoded RGB 0..1 (H, W, 3) as an 8-bit PNG."""
    pixels = np.rint(np.clip(color, 0, 1) * 255).astype(np.uint8)
    _, encoded = cv2.imencode(".png", np.ascontiguousarray(pixels[..., ::-1]))
    with atomic_write(path, "wb", one_of_many=True) as file:
        file.write(encoded.tobytes())


def _time(renderer: Renderer, camera: Camera, repeat: int) -> list[float]:
    """Milliseconds of `repeat` draws; the caller's own draw was the warm-up."""
    times = []
    for _ in range(max(0, repeat)):
        began = time.perf_counter()
        renderer.render(camera.intrinsics, camera.pose)
        times.append(1e3 * (time.perf_counter() - began))
    return times
