"""`track SCENE PLATE --out TRACK.json`: the camera of every frame of a moving plate. `track SCENE PLATES... --out-dir DIR`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from ...batch.keys import check_unchanged, key_of, scan_file_digest, stamp
from ...errors import UsageError
from ...photos.plate import open_plate
from ...pose.settings import RefineSettings
from ...render import ProcessRenderer, RenderSettings
from ...splats import GaussianScene, read_splats
from ...support.words import counted
from ...track import FocalKind, Track, TrackSettings
from ...track.file import read_track
from ...track.journal import is_other_file
from ..console import message, say
from ..dropped import say_dropped
from ..flags import MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, number, settings_from, whole_number
from ..maps import MapFlags, add_map_flags, check_results
from ..outcome import FAILED_VERDICT, OK, Outcome
from ..paths import check_outputs
from ..plates.given import camera_files, frames_of
from ..plates.job import ShotJob, journal_of
from ..plates.several import ShotEnd, finished, out_files, say_table, track_all
from ..shots import PlateFrames, ShotWork

LISTED = 10


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("track", help="the camera of every frame of a moving plate, or of several")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("plates", type=Path, nargs="+", metavar="plate", help="a movie, or any image of a numbered sequence")
    parser.add_argument("--out", type=Path, metavar="TRACK.json", help="where to write the cameras")
    several = "a folder for the cameras of several plates, each in PLATE.json; what is finished there is not tracked again"
    parser.add_argument("--out-dir", type=Path, metavar="DIR", help=several)
    parser.add_argument("--frames", metavar="A-B", help="first and last frame (all; a movie's frames begin at 1)")
    start = "a rough camera of a frame (any camera file), or a file of cameras that name frames; may be repeated; without it "
    start += "a frame is searched for"
    parser.add_argument("--start", action="append", default=[], metavar="[FRAME=]CAMERAS", help=start)
    pin = "a camera whose pose a frame is to have exactly; may be repeated"
    parser.add_argument("--pin", action="append", default=[], metavar="[FRAME=]CAMERAS", help=pin)
    again = "a track of this plate: --frames are tracked anew, tied to those beside them, and all others kept"
    parser.add_argument("--from", type=Path, dest="before", metavar="TRACK.json", help=again)
    parser.add_argument("--mask", type=Path, metavar="DIR", help=MASK_HELP)
    focal = parser.add_mutually_exclusive_group()
    focal.add_argument("--zoom", action="store_true", help="the lens zooms: a focal length for each frame, on a smooth curve")
    breathing = "the picture grows and shrinks a little with the focus: as --zoom, slower and by less"
    focal.add_argument("--breathing", action="store_true", help=breathing)
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
    _check_usage(args)
    if args.out_dir is not None:
        return _several(args, settings)
    digest = scan_file_digest(args.scene, dated=False)
    job = _job(args, settings, args.plates[0], args.out, digest)
    with _work(args, settings, digest) as work_on:
        return _told(job, job.run(work_on(job)))


def _check_usage(args: argparse.Namespace) -> None:
    if (args.out is None) == (args.out_dir is None):
        raise UsageError("Say where to write the cameras: --out TRACK.json for one plate, or --out-dir DIR for several.")
    if args.out is not None and len(args.plates) > 1:
        raise UsageError(f"{len(args.plates)} plates cannot be written to one file; give --out-dir DIR in place of --out.")
    numbered = [text for text in (*args.start, *args.pin) if "=" in text]
    single = {"--frames": args.frames, "FRAME=CAMERAS": numbered, "--from": args.before}
    given = [flag for flag, value in single.items() if value]
    if args.out_dir is not None and given:
        raise UsageError(f"{given[0]} is for one plate; give --out TRACK.json in place of --out-dir.")
    if args.before is not None and args.frames is None:
        raise UsageError("--from needs the frames to track anew; give them with --frames A-B.")


def _several(args: argparse.Namespace, settings: RefineSettings) -> Outcome:
    files = out_files(args.plates, args.out_dir)
    args.out_dir.mkdir(parents=True, exist_ok=True)
    digest = scan_file_digest(args.scene, dated=False)
    with _work(args, settings, digest) as work_on:

        def track(plate: Path, out: Path) -> ShotEnd:
            job = _job(args, settings, plate, out, digest)
            before = finished(out, job.key)
            if before is not None:
                return ShotEnd(plate, out, before, kept=True)
            found = job.run(work_on(job))
            _told(job, found)
            return ShotEnd(plate, out, found)

        ends = track_all(files, track)
    say_table(ends)
    return Outcome(FAILED_VERDICT if any(end.failed for end in ends) else OK)


def _job(args: argparse.Namespace, settings: RefineSettings, path: Path, out: Path, digest: str) -> ShotJob:
    """The job of a plate in the scan of `digest`. Raises GssmcError where the flags, the plate or its files cannot be used."""
    focal: FocalKind = "zoom" if args.zoom else "breathing" if args.breathing else "fixed"
    chosen = TrackSettings(args.track_long_side, settings.lens != "fixed", args.rolling_shutter, args.smooth, focal)
    plate, first, last = open_plate(path)
    frames = frames_of(args.frames, plate, first, last)
    starts = camera_files("--start", args.start, frames, plate)
    pins = camera_files("--pin", args.pin, frames, plate)
    inputs = {"a frame": [plate.file(frame) for frame in range(first, last + 1)]}
    inputs |= {"a start": [*starts.values()], "a pin": [*pins.values()]}
    inputs |= {"the track that it begins with": [] if args.before is None else [args.before]}
    photos = PlateFrames(plate, args.mask).seen_now(frames)
    _check_files(args, photos, frames, inputs, out)
    before = None if args.before is None else read_track(args.before)
    key = key_of(3, digest, str(path.resolve()), list(photos.seen.items()), args.start)
    key = key_of(key, asdict(settings), asdict(chosen), str(args.mask), args.axes)
    key = key_of(
        key, args.pin, *(stamp(file) for file in (*starts.values(), *pins.values())), args.before and stamp(args.before)
    )
    return ShotJob(photos, frames, starts, pins, before, chosen, out, key)


@contextmanager
def _work(args: argparse.Namespace, settings: RefineSettings, digest: str) -> Iterator[Callable[[ShotJob], ShotWork]]:
    """What the work on a plate needs; the scan, which is that of `digest`, is read once for all, and so is who draws it."""
    flags = MapFlags(args, settings.threads)
    scene: GaussianScene = read_splats(args.scene)
    check_unchanged(args.scene, digest)
    say_dropped(scene)
    with ProcessRenderer(scene, RenderSettings.for_scene(scene, settings.threads)) as renderer:
        search = flags if args.locate else None
        zooms = args.zoom or args.breathing
        yield lambda job: ShotWork(scene, renderer, settings, job.photos, search, args.axes, zooms)


def _told(job: ShotJob, track: Track) -> Outcome:
    """The outcome, after the weak frames and the verdict were said."""
    bad = [frame for frame in track.frames if frame.state != "good"]
    for frame in bad[:LISTED]:
        message(f"Frame {frame.frame} is {frame.state}: {frame.reason}")
    if len(bad) > LISTED:
        message(f"... and {len(bad) - LISTED} more in '{job.out}'.")
    say(f"{track.verdict} after {track.seconds:.1f} s. {' '.join(track.reasons)}")
    return Outcome(FAILED_VERDICT if track.verdict == "failed" else OK)


def _check_files(
    args: argparse.Namespace, photos: PlateFrames, frames: range, inputs: dict[str, list[Path]], out: Path
) -> None:
    """Raises UsageError when what is to be written would overwrite something, or no frame has a mask."""
    journal = journal_of(out)
    masks = [mask for mask in map(photos.mask, frames) if mask is not None]
    if args.mask is not None and not masks:
        raise UsageError(f"'{args.mask}' has no mask for any frame; name a mask as its frame, with .png behind it.")
    flag = "--out" if args.out_dir is None else "--out-dir"
    read = {"the scan": args.scene, "the known cameras": args.cameras, "a mask": masks, **inputs}
    check_outputs({flag: out, "--map": args.map, f"the journal of {flag}": journal}, read)
    check_results({flag: out}, args.scene)
    if is_other_file(journal):
        raise UsageError(f"'{journal}' is no journal of a track, and would be written over; move it, or give another --out.")
    if masks and len(masks) < len(frames):
        message(f"{len(masks)} of {counted(len(frames), 'frame')} have a mask.")
