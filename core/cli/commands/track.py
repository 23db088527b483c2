"""`track SCENE PLATE --out TRACK.json`: the camera of every frame of a moving plate."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from ...batch.keys import key_of, scan_file_digest, stamp
from ...errors import UsageError
from ...photos.plate import Plate, behind_gaps, open_plate
from ...render import ProcessRenderer, RenderSettings
from ...splats import read_splats
from ...support.words import counted
from ...track import Shot, Track, TrackSettings, iterate_track
from ...track.file import track_to_dict
from ...track.journal import is_other_file, read_found, write_found
from ..console import message, say
from ..dropped import say_dropped
from ..flags import MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, number, settings_from, whole_number
from ..maps import MapFlags, add_map_flags, check_results
from ..outcome import FAILED_VERDICT, INTERRUPTED, OK, Outcome
from ..paths import check_outputs
from ..progress import ProgressBar
from ..result import write_json
from ..shots import PlateFrames, ShotWork

JOURNAL = ".journal"
SAVE_EVERY_S = 60.0
LISTED = 10


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("track", help="the camera of every frame of a moving plate")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("plate", type=Path, help="a movie, or any image of a numbered sequence")
    parser.add_argument("--out", type=Path, required=True, metavar="TRACK.json", help="where to write the cameras")
    parser.add_argument("--frames", metavar="A-B", help="first and last frame (all; a movie's frames begin at 1)")
    start = "a rough camera of a frame (any camera file); may be repeated; without it a frame is searched for"
    parser.add_argument("--start", action="append", default=[], metavar="FRAME=CAMERAS", help=start)
    parser.add_argument("--mask", type=Path, metavar="DIR", help=MASK_HELP)
    shutter = "solve for the time that reading a frame out takes (a rolling shutter)"
    parser.add_argument("--rolling-shutter", action="store_true", help=shutter)
    smooth = "take out wiggles of the camera shorter than this many frames (0: none)"
    parser.add_argument("--smooth", type=number, default=0.0, metavar="FRAMES", help=smooth)
    size = "frames are matched at this length of their longer side, pixels (640)"
    parser.add_argument("--track-long-side", type=whole_number, default=640, metavar="PX", help=size)
    add_axes_flag(parser)
    add_map_flags(parser, switch=True)
    add_settings_flags(parser)
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args)
    track_settings = TrackSettings(args.track_long_side, settings.lens != "fixed", args.rolling_shutter, args.smooth)
    plate, first, last = open_plate(args.plate)
    frames = _range(args.frames, first, last)
    starts = _start_files(args.start, frames)
    photos = PlateFrames(plate, args.mask)
    _check_files(args, photos, range(first, last + 1), starts)
    flags = MapFlags(args, settings.threads)
    _say_left_out(plate, first, last)
    scene = read_splats(args.scene)
    say_dropped(scene)
    key = key_of(1, scan_file_digest(args.scene), str(args.plate.resolve()), stamp(args.plate), list(frames), args.start)
    key = key_of(key, asdict(settings), asdict(track_settings), str(args.mask), args.axes)
    with ProcessRenderer(scene, RenderSettings.for_scene(scene, settings.threads)) as renderer:
        work = ShotWork(scene, renderer, settings, photos, flags if args.locate else None, args.axes)
        return _tracked(work, _ShotJob(args, frames, starts, track_settings, key))


@dataclass(frozen=True)
class _ShotJob:
    """What is to be tracked: `frames` in order, camera files by frame, and the `key` of what the answer depends on."""

    args: argparse.Namespace
    frames: Sequence[int]
    starts: dict[int, Path]
    settings: TrackSettings
    key: str

    @property
    def journal(self) -> Path:
        out: Path = self.args.out
        return out.with_name(out.name + JOURNAL)


def _tracked(work: ShotWork, job: _ShotJob) -> Outcome:
    found = read_found(job.journal, job.key)
    if found.ties:
        message(f"{len(found.ties)} of {counted(len(job.frames), 'frame')} were found before and are kept.")
    saved = time.monotonic()
    try:
        starts = work.starts(job.frames, job.starts)
        shot = Shot(work.frames.read, job.frames, work.recover, work.frames.name, " ".join(work.doubts))
        with ProgressBar("Tracking") as bar:
            steps = iterate_track(work.renderer, shot, starts, job.settings, found)
            while True:
                try:
                    step = next(steps)
                except StopIteration as end:
                    track: Track = end.value
                    break
                bar.show(step.fraction, f"frame {step.frame}")
                if time.monotonic() - saved > SAVE_EVERY_S:
                    write_found(job.journal, found, job.key)
                    saved = time.monotonic()
    except KeyboardInterrupt:
        write_found(job.journal, found, job.key)
        message(f"Interrupted; {counted(len(found.ties), 'frame')} found, in '{job.journal}'. The same command goes on.")
        return Outcome(INTERRUPTED)
    return _end(work, job, track)


def _end(work: ShotWork, job: _ShotJob, track: Track) -> Outcome:
    origin = [-value for value in work.scene.origin]
    cameras = tuple(frame.camera.relative_to(origin) for frame in track.frames)
    placed = replace(track, frames=tuple(replace(f, camera=c) for f, c in zip(track.frames, cameras, strict=True)))
    write_json(job.args.out, track_to_dict(placed))
    job.journal.unlink(missing_ok=True)
    bad = [frame for frame in track.frames if frame.state != "good"]
    for frame in bad[:LISTED]:
        message(f"Frame {frame.frame} is {frame.state}: {frame.reason}")
    if len(bad) > LISTED:
        message(f"... and {len(bad) - LISTED} more in '{job.args.out}'.")
    say(f"{track.verdict} after {track.seconds:.1f} s. {' '.join(track.reasons)}")
    return Outcome(FAILED_VERDICT if track.verdict == "failed" else OK)


def _check_files(args: argparse.Namespace, photos: PlateFrames, frames: range, starts: dict[int, Path]) -> None:
    """Raises UsageError when what is to be written would overwrite something, or no frame has a mask."""
    journal = args.out.with_name(args.out.name + JOURNAL)
    masks = [mask for mask in map(photos.mask, frames) if mask is not None]
    if args.mask is not None and not masks:
        raise UsageError(f"'{args.mask}' has no mask for any frame; name a mask as its frame, with .png behind it.")
    inputs = {
        "the scan": args.scene,
        "the known cameras": args.cameras,
        "a frame": [Path(photos.name(frame)) for frame in frames],
        "a start": list(starts.values()),
        "a mask": masks,
    }
    check_outputs({"--out": args.out, "--map": args.map, "the journal of --out": journal}, inputs)
    check_results({"--out": args.out}, args.scene)
    if is_other_file(journal):
        raise UsageError(f"'{journal}' is no journal of a track, and would be written over; move it, or give another --out.")
    if masks and len(masks) < len(frames):
        message(f"{len(masks)} of {counted(len(frames), 'frame')} have a mask.")


def _say_left_out(plate: Plate, first: int, last: int) -> None:
    others = behind_gaps(plate, first, last)
    if others:
        lie = "lies behind a gap and is" if len(others) == 1 else "lie behind a gap and are"
        files = f"{counted(len(others), 'file')} of the sequence, from {others[0]} to {others[-1]}"
        message(f"The plate's frames are {first} to {last}; {files}, {lie} left out.")


def _range(text: str | None, first: int, last: int) -> range:
    """The frames that A-B names, of those there are. Raises UsageError."""
    if text is None:
        return range(first, last + 1)
    a, dash, b = text.partition("-")
    if not (a.isdigit() and (b.isdigit() or not dash)):
        raise UsageError(f"--frames is '{text}'; give the first and the last frame, such as {first}-{last}.")
    low, high = int(a), int(b) if dash else int(a)
    if low > high:
        raise UsageError(f"--frames is {text}, which ends before it begins; exchange the two.")
    if not first <= low <= high <= last:
        raise UsageError(f"--frames is {text}, but the plate has the frames {first} to {last}.")
    return range(low, high + 1)


def _start_files(given: Sequence[str], frames: range) -> dict[int, Path]:
    """The camera files of --start by frame. Raises UsageError."""
    out = {}
    for text in given:
        frame, equals, file = text.partition("=")
        if not (frame.isdigit() and equals and file):
            raise UsageError(f"--start is '{text}'; give a frame and a camera file, such as {frames[0]}=CAMERA.json.")
        if int(frame) not in frames:
            raise UsageError(f"--start names frame {frame}, which is not among {frames[0]} to {frames[-1]}.")
        if int(frame) in out:
            raise UsageError(f"--start names frame {frame} twice; give one camera for it.")
        out[int(frame)] = Path(file)
    return out
