"""`refine SCENE PHOTO [--camera CAM.json]`: the exact camera of one photo, from a rough start or without one."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ...batch.find_one import find_target, found_to_dict, joined, whole_found
from ...batch.place import into_file, starts_in_scene
from ...batch.refine_one import read_masked_photo, refine_starts
from ...cameras import camera_file, short
from ...cameras.files import StartCamera
from ...cameras.names import names_photo
from ...cameras.training_world import Axes, ScanAxes
from ...cameras.unplaced import Unplaced
from ...errors import CameraError, PhotoError, UsageError
from ...geometry.camera import Camera
from ...geometry.pinhole_cut import WideCamera
from ...photos.lens_guess import guess_lens
from ...photos.mask import find_mask
from ...photos.photo import Photo
from ...pictures.stmap import read_stmap, through_map
from ...pose.pins.report import PinReport
from ...pose.refine import iterate_refinement
from ...pose.report import RefineReport
from ...pose.report_json import report_to_dict
from ...pose.settings import RefineSettings
from ...render import ProcessRenderer, RenderSettings
from ...render.scan.opening import open_scan
from ...render.view import ViewRenderer
from ...splats import GaussianScene, read_splats
from ...support.steps import run_to_end
from ..console import message
from ..dropped import say_dropped
from ..flags import CAMERAS_HELP, MASK_HELP, SCENE_HELP, add_axes_flag, add_settings_flags, settings_from
from ..maps import MapFlags, add_map_flags, check_results, find_with_progress
from ..outcome import FAILED_VERDICT, OK, Outcome, shown
from ..paths import check_outputs
from ..pinning import Pinning
from ..progress import ProgressBar
from ..result import put_result

PINS_HELP = (
    "pairs of a pixel of the photo and a point of the scan, set by hand: the refinement begins where they place the camera and "
    "holds them in its last stage"
)
STMAP_HELP = "an ST map that undistorts the photo; the camera is then that of the undistorted picture, without distortion"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    parser = commands.add_parser("refine", help="find the exact camera of one photo from a rough start, or without one")
    parser.add_argument("scene", type=Path, help=SCENE_HELP)
    parser.add_argument("photo", type=Path, help="the photograph (JPEG, PNG, TIFF, WebP, AVIF, and those of docs/formats.md)")
    start = "the start: rough pose, and lens where known; without it, or without a pose in it, the photo is searched for"
    parser.add_argument("--camera", type=Path, metavar="CAMERAS", help=f"{start}; {CAMERAS_HELP}")
    parser.add_argument("--mask", type=Path, metavar="FILE_OR_DIR", help=MASK_HELP)
    parser.add_argument("--pins", type=Path, metavar="PINS.json", help=PINS_HELP)
    parser.add_argument("--stmap", type=Path, metavar="MAP.exr", help=STMAP_HELP)
    parser.add_argument("--out", type=Path, metavar="RESULT.json", help="where to write the result (stdout)")
    add_axes_flag(parser)
    add_map_flags(parser, switch=True)
    add_settings_flags(parser)
    parser.set_defaults(make_renderer=ProcessRenderer)  # a program that this runs in may have another
    return parser


def run(args: argparse.Namespace) -> Outcome:
    settings = settings_from(args)
    mask = None if args.mask is None else mask_file(args.mask, args.photo)
    _check_paths(args, settings, mask)
    if args.pins is not None and args.stmap is not None:
        raise UsageError("--pins and --stmap cannot go together: pins are pixels of the photo as it is; leave one of them out.")
    if args.camera is None and not args.locate and args.pins is None:
        raise UsageError("There is no start to refine from; give it with --camera, or leave out --no-locate.")
    flags = MapFlags(args, settings.threads)
    photo = read_masked_photo(args.photo, mask)
    if args.stmap is not None:
        photo = through_map(photo, read_stmap(args.stmap), args.stmap.name)
    for remark in photo.notes:
        message(remark)
    told = Unplaced() if args.camera is None else pick_wanted(args.camera, args.photo)
    if isinstance(told, Unplaced) and not args.locate and args.pins is None:
        raise CameraError(f"The camera in '{args.camera.name}' has no R and t; give a start, or leave out --no-locate.")
    wanted = wanted_camera(told, photo)
    if args.stmap is not None:
        wanted = straight(wanted)
    opened = _opened(args, settings.threads)
    scene = opened.scene
    say_dropped(scene, opened.count)
    with opened.renderer as renderer:
        if args.pins is None:
            placing = Placing(renderer, scene, settings, flags if args.locate else None, opened.whole)
            placed = placing.place(photo, wanted, args.axes)
        else:
            pinned = Pinning(renderer, scene, args.axes).place(photo, wanted, args.pins, "auto")
            placed = refined_pins(renderer, photo, pinned, settings)
            placed = Placed(into_file(placed.record, scene.origin), placed.report)
    if args.stmap is not None:
        placed.record["stmap"] = str(args.stmap)
    put_result(args.out, placed.record)
    code = FAILED_VERDICT if placed.record["verdict"] == "failed" else OK
    if placed.report is None:
        return Outcome(code, args.scene)
    camera, photo_file = shown(placed.report.camera.relative_to([-value for value in scene.origin]), args.photo)
    photo_file = None if args.stmap else photo_file
    return Outcome(code, args.scene, (camera,), (photo_file,), (placed.report,), (mask if photo_file else None,))


@dataclass(frozen=True, eq=False)
class _Opened:
    """The scan opened: what draws it, its Gaussians or some of them, how many there are, and how to get them all."""

    renderer: AbstractContextManager[ViewRenderer]
    scene: GaussianScene
    count: int
    whole: Callable[[], GaussianScene]


def _opened(args: argparse.Namespace, threads: int) -> _Opened:
    """Only the processes that draw here take a scan that is prepared."""
    if args.make_renderer is not ProcessRenderer:
        scene = read_splats(args.scene)
        renderer = args.make_renderer(scene, RenderSettings.for_scene(scene, threads))
        return _Opened(renderer, scene, len(scene), lambda: scene)
    scan = open_scan(args.scene)
    drawing = ProcessRenderer(scan.tables, scan.settings(threads))
    return _Opened(drawing, scan.sample, scan.count, partial(read_splats, args.scene))


def _check_paths(args: argparse.Namespace, settings: RefineSettings, mask: Path | None) -> None:
    models = [Path(name) for name in (settings.model, settings.matcher_model) if name]
    inputs = {"the scan": args.scene, "the photo": args.photo, "the start": args.camera, "the mask": mask, "a model": models}
    inputs |= {"the ST map": args.stmap, "the pins": args.pins}
    check_outputs(
        {"--out": args.out, "--map": args.map},
        {**inputs, "the known cameras": args.cameras},
    )
    check_results({"--out": args.out}, args.scene)


class Placed:
    """The end: its record, and the report of the camera that was kept, None where there is no camera at all."""

    def __init__(self, record: dict[str, Any], report: RefineReport | None) -> None:
        self.record, self.report = record, report


class Placing:
    """Places photos in one scan: from their start, and where that fails or there is none, without it."""

    def __init__(
        self,
        renderer: ViewRenderer,
        scene: GaussianScene,
        settings: RefineSettings,
        flags: MapFlags | None,
        whole: Callable[[], GaussianScene] | None = None,
    ) -> None:
        """`flags` None: photos are not searched for. `whole`: reads the scan, of which `scene` has some Gaussians then."""
        self._renderer, self._scene, self._settings, self._flags = renderer, scene, settings, flags
        self._whole = whole or (lambda: scene)

    def place(self, photo: Photo, wanted: Camera | Unplaced, axes: Axes = "auto") -> Placed:
        """The end, in the coordinates of the scan's file; `axes`: those of a start."""
        placed = self._placed(photo, wanted, axes)
        return Placed(into_file(placed.record, self._scene.origin), placed.report)

    def _placed(self, photo: Photo, wanted: Camera | Unplaced, axes: Axes) -> Placed:
        if isinstance(wanted, Unplaced):
            return self._find(photo, wanted)
        starts = starts_in_scene(wanted, ScanAxes.of(self._scene), axes, self._scene.origin)
        with ProgressBar("Refining") as bar:
            report = refine_starts(self._renderer, photo, starts, self._settings, lambda p: bar.show(p.fraction, p.step))
            bar.show(1.0, report.verdict)
        told = [sentence for _, sentence in starts if sentence in report.reasons]
        for sentence in told:
            message(sentence)
        first = Placed(report_to_dict(report), report)
        whole_view = isinstance(wanted, WideCamera) and wanted.lens.is_panorama
        if report.verdict != "failed" or self._flags is None or whole_view:
            return first
        message("The refinement from the start failed; the photo is searched for without it.")
        found = self._find(photo, Unplaced.of(wanted))
        record = joined(first.record, found.record)
        return Placed(record, replace(found.report or report, reasons=tuple(record["reasons"]), seconds=record["seconds"]))

    def _find(self, photo: Photo, wanted: Unplaced) -> Placed:
        assert self._flags is not None
        target = find_target(photo, wanted)
        found = find_with_progress(self._renderer, target, self._flags.cache(self._whole()), self._settings)
        found = whole_found(photo, found, wanted)
        if found.camera is None or found.refined is None:
            return Placed(found_to_dict(found, wanted), None)
        return Placed(found_to_dict(found, wanted), replace(found.refined, seconds=found.seconds))


def refined_pins(renderer: ViewRenderer, photo: Photo, pinned: PinReport, settings: RefineSettings) -> Placed:
    """The refinement that begins where pins place the camera, and holds them; where it fails, that camera is what is left."""
    message(" ".join(pinned.reasons))
    with ProgressBar("Refining") as bar:
        steps = iterate_refinement(renderer, photo, pinned.camera, settings, pinned.pins)
        report = run_to_end(steps, lambda p: bar.show(p.fraction, p.step))
        bar.show(1.0, report.verdict)
    if report.verdict == "failed":
        report = replace(report, reasons=(*report.reasons, "The camera is the one that the pins place."))
    return Placed(report_to_dict(report), report)


def mask_file(masks: Path, photo: Path) -> Path:
    """The photo's mask. Raises PhotoError when a folder has none for it."""
    found = find_mask(masks, photo)
    if found is None:
        raise PhotoError(
            f"The folder '{masks}' has no mask for '{photo.name}'; name it '{photo.name}.png' or '{photo.stem}.png'."
        )
    return found


def wanted_camera(wanted: StartCamera | Unplaced, photo: Photo) -> Camera | Unplaced:
    """The camera to start from, or what is known of it, with the lens that the photo suggests where the file tells none, which
    is said then.
    """
    guess = guess_lens(photo)
    if wanted.tells_no_lens:
        message(
            f"{'The start tells no lens' if isinstance(wanted, StartCamera) else 'The lens is not known'}: {guess.assumption}."
        )
    if isinstance(wanted, Unplaced):
        return replace(wanted.with_guess(guess.intrinsics), file=photo.file)
    return replace(wanted.camera(guess.intrinsics, photo.orientation), file=photo.file)


def straight(wanted: Camera | Unplaced) -> Camera | Unplaced:
    """What is known of the camera of an undistorted picture: no distortion, for the map takes it away. Raises CameraError."""
    if isinstance(wanted, WideCamera) or (isinstance(wanted, Unplaced) and wanted.wide is not None):
        raise CameraError("The camera's lens is that of the photo, not of the undistorted picture; give the pinhole of that.")
    if wanted.intrinsics is None or not wanted.intrinsics.has_distortion:
        return wanted
    message("The distortion in the camera file is left out, because the ST map undistorts the photo.")
    return replace(wanted, intrinsics=wanted.intrinsics.pinhole())


def pick_wanted(file: Path, photo: Path) -> StartCamera | Unplaced:
    """The record for the photo in a camera file of any layout, whose notes are said. Raises CameraError when the file has none,
    or several.
    """
    found = camera_file(file)
    for note in found.notes:
        message(note)
    record = found.record_of(str(photo.absolute()), file.name)
    if record.file and not names_photo(record.file, photo.name):
        message(f"The one camera in '{file.name}' is that of '{short(record.file)}'; it is used for '{photo.name}'.")
    return record
