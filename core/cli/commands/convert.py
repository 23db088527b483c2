"""`convert CAMERAS OUT`: cameras from one layout into another, and between nerfstudio's two worlds. `convert SCENE OUT`: see
`convert_scene`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ...cameras import colmap, nerfstudio, pose_list, starts
from ...cameras.animated import chan
from ...cameras.files import StartCamera
from ...cameras.training_world import AXES, FILE, ScanAxes, read_training_world
from ...errors import DatasetError, UsageError
from ...geometry.camera import Camera
from ...geometry.conventions import Similarity
from ...photos.plate import number_of
from ...splats import read_splats
from ...support.atomic import atomic_write
from ...support.words import counted
from ...track.file import frame_numbers
from ..console import message, say
from ..convert_scene import WRITERS as SCENE_WRITERS
from ..convert_scene import convert_scene, is_scene
from ..flags import CAMERAS_HELP, SCENE_HELP, add_axes_flag, whole_number
from ..outcome import OK, Outcome
from ..paths import check_outputs

CHAN = "chan"
SUFFIXES = {".json": "json", ".txt": "poses", ".chan": CHAN, "": "colmap"}
# A file of this name is nerfstudio's to every program that asks for it.
NAMES = {nerfstudio.FILE: "nerfstudio"}


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    text = "write cameras in another layout, or in the world of a nerfstudio splat; or a splat scan in another format"
    parser = commands.add_parser("convert", help=text)
    parser.add_argument("cameras", type=Path, help=f"{CAMERAS_HELP}; or a {SCENE_HELP}")
    scenes = ", ".join(SCENE_WRITERS)
    parser.add_argument("out", type=Path, help=f"file or, for COLMAP, folder to write; for a scan a file ending in {scenes}")
    layouts = "layout of OUT (by its name: transforms.json = nerfstudio, .json, .txt = poses, .chan = Nuke, none = colmap)"
    parser.add_argument("--to", choices=[*WRITERS, CHAN], help=layouts)
    level = "of a streamed scan: the level that is written, 0 = the finest (0)"
    parser.add_argument("--level", type=whole_number, default=0, metavar="N", help=level)
    scan = "the splat file that the cameras belong to: they are written in its coordinates, or as --to-axes says"
    parser.add_argument("--scan", type=Path, metavar="SCENE", help=scan)
    add_axes_flag(parser)
    to_axes = "of the cameras written, with --scan (file)"
    parser.add_argument("--to-axes", choices=AXES[1:], default=AXES[1], help=to_axes)
    world = parser.add_mutually_exclusive_group()
    world.add_argument("--into-training-world", type=Path, metavar=FILE, help="from transforms.json's world to the splat's")
    world.add_argument("--out-of-training-world", type=Path, metavar=FILE, help="from the splat's world to transforms.json's")
    return parser


def run(args: argparse.Namespace) -> Outcome:
    if args.to is None and is_scene(args.out):
        convert_scene(args.cameras, args.out, args.level)
        return Outcome(OK)
    layout = args.to or NAMES.get(args.out.name.lower()) or SUFFIXES.get(args.out.suffix.lower())
    if layout is None:
        raise DatasetError(f"The ending of '{args.out.name}' tells no layout; say --to {', --to '.join([*WRITERS, CHAN])}.")
    _check_paths(args, layout)
    if args.scan is None and (args.axes, args.to_axes) != (AXES[0], AXES[1]):
        raise UsageError("--axes and --to-axes need the scan that the cameras belong to; give it with --scan.")
    world = _world(args.into_training_world, args.out_of_training_world)
    read = starts(args.cameras)
    found = list(read.placed)
    for note in (*read.notes, *_unfinished(found)):
        message(note)
    if world is not None:
        found = [replace(start, pose=world.pose_to_scene(start.pose)) for start in found]
    if args.scan is not None:
        found = _beside_scan(found, args)
    if layout == CHAN:
        _chan(args.out, found, args.cameras)
    else:
        WRITERS[layout](args.out, _named_apart(found, args.cameras) if layout in UNIQUE else found)
    say(f"{counted(len(found), 'camera')} {'was' if len(found) == 1 else 'were'} written to '{args.out}'.")
    return Outcome(OK)


def _beside_scan(found: Sequence[StartCamera], args: argparse.Namespace) -> list[StartCamera]:
    """The cameras in the coordinates of a scan's file, or in the world of its training."""
    scan = ScanAxes.of(read_splats(args.scan))
    settled, sentence = scan.settled(found, args.axes)
    if sentence:
        message(sentence)
    return settled if args.to_axes == "file" else scan.into_training_world(settled)


def _unfinished(found: Sequence[StartCamera]) -> list[str]:
    """What is told of lenses that cannot be written, because they need their photos' sizes."""
    count = sum(start.lens_of_size is not None for start in found)
    text = f"The lens of {counted(count, 'camera')} needs the size of the photo, which is not told, and is not written."
    return [text] if count else []


def _check_paths(args: argparse.Namespace, layout: str) -> None:
    """Raises UsageError when what is to be written would overwrite what is read."""
    names = (colmap.CAMERAS, colmap.IMAGES, colmap.POINTS) if layout == "colmap" else ()
    outputs = {f"The file {name}": args.out / name for name in names} or {"OUT": args.out}
    # a file of a COLMAP model is read with the cameras beside it
    beside = args.cameras.iterdir() if args.cameras.is_dir() else (args.cameras.with_name(colmap.CAMERAS),)
    read = [args.cameras, *beside]
    worlds = [path for path in (args.into_training_world, args.out_of_training_world) if path is not None]
    check_outputs(outputs, {"the cameras that are read": read, "the training's world": worlds, "the scan": args.scan})


def _world(into: Path | None, out_of: Path | None) -> Similarity | None:
    if into is not None:
        return read_training_world(into)
    return read_training_world(out_of).inverse() if out_of is not None else None


def _json(path: Path, found: Sequence[StartCamera]) -> None:
    with atomic_write(path) as file:
        json.dump({"frames": [start.to_dict() for start in found]}, file, indent=1)


def _poses(path: Path, found: Sequence[StartCamera]) -> None:
    pose_list.write(path, [(start.file, start.pose) for start in found])


def _colmap(path: Path, found: Sequence[StartCamera]) -> None:
    cameras = _with_lenses(found)
    path.mkdir(parents=True, exist_ok=True)
    colmap.write_model(path, cameras)


def _nerfstudio(path: Path, found: Sequence[StartCamera]) -> None:
    nerfstudio.write_transforms(path, _with_lenses(found))


def _chan(path: Path, found: Sequence[StartCamera], source: Path) -> None:
    cameras = _with_lenses(found)
    numbers = frame_numbers(source)
    if len(numbers) != len(found):
        numbers = [number for start in found if (number := number_of(start.file)) is not None]
    if len(set(numbers)) != len(found):
        raise DatasetError("The cameras are not those of numbered frames, one each; give a track, or cameras of a sequence.")
    told = chan.lacking(cameras)
    if told:
        message(told)
    chan.write_chan(path, list(zip(numbers, cameras, strict=True)))


def _named_apart(found: Sequence[StartCamera], source: Path) -> list[StartCamera]:
    """The cameras, each with a file of its own: those of a movie are named as pictures that are taken out of it would be."""
    numbers = frame_numbers(source)
    if len(numbers) != len(found) or len({start.file for start in found}) == len(found):
        return list(found)
    named = [replace(s, file=f"{Path(s.file).stem}.{n:04d}.png") for s, n in zip(found, numbers, strict=True)]
    message(f"The frames of the movie are named '{named[0].file}' to '{named[-1].file}'; take its pictures out as these.")
    return named


def _with_lenses(found: Sequence[StartCamera]) -> list[Camera]:
    out = []
    for number, start in enumerate(found, 1):
        if start.intrinsics is None and start.wide is None:
            raise DatasetError(f"Camera {number} has no lens, which this layout needs; write --to json or --to poses.")
        out.append(start.known_camera())
    return out


# Layouts that name a picture for each camera.
UNIQUE = frozenset({"poses", "colmap", "nerfstudio"})
WRITERS: dict[str, Callable[[Path, Sequence[StartCamera]], None]] = {
    "json": _json,
    "poses": _poses,
    "colmap": _colmap,
    "nerfstudio": _nerfstudio,
}
