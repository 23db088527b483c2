"""What a batch is to do: start cameras with their photos, from a camera file or from a data set's folder."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..cameras import camera_file, has_queries, match_names, queries, read
from ..cameras.files import StartCamera
from ..cameras.pose_list import checked
from ..cameras.unplaced import Unplaced
from ..errors import CameraError, DatasetError, PhotoError, UsageError
from ..geometry.camera import Camera, Intrinsics
from ..photos.lens_guess import DEFAULT_FOV_DEG, LensGuess, guess_lens_of_file
from ..photos.places import PhotoFinder

# The lens of a photo that cannot be read; the photo is refused when its turn comes.
LENS_OF_UNREADABLE = Intrinsics(1920, 1080, 1920, 1920, 960, 540)


@dataclass(frozen=True)
class BatchPhotos:
    """Start cameras, or lenses of photos without a start, whose "file" is the photo's name as the source spells it, and as many
    photo files; `notes` are sentences on what was assumed or left out, for whoever asked.
    """

    cameras: list[Camera | Unplaced]
    photos: list[Path]
    notes: tuple[str, ...] = ()


def find_queries(args: argparse.Namespace) -> BatchPhotos:
    """The queries of a batch's flags; `args.locate` tells whether photos without a start are found as well.

    Raises UsageError, DatasetError or CameraError.
    """
    if args.queries.is_dir() and has_queries(args.queries):
        found = _from_dataset(args.queries, args.start, args.focal, args.locate)
    else:
        found = _from_cameras(args.queries, args.start, args.focal)
    if not args.locate:
        _check_placed(found, args.queries)
    if args.poses is not None:
        for camera in found.cameras:
            # A name that cannot be written is found before hours of work, not after them.
            checked(camera.file)
    return found


def _check_placed(found: BatchPhotos, source: Path) -> None:
    for number, camera in enumerate(found.cameras, 1):
        if isinstance(camera, Unplaced):
            raise CameraError(f"Camera {number} of '{source.name}' has no R and t; give a start, or leave out --no-locate.")


def _from_dataset(folder: Path, start: Path | None, focal: float | None, locate: bool) -> BatchPhotos:
    """Test photos of a scene folder. Those without a start pose have to be found, or are left out, and that is said."""
    if start is None and not locate:
        raise UsageError(f"'{folder.name}' is a data set's folder, which has no start poses; give them with --start POSES.txt.")
    if focal is not None and not 0 < focal < float("inf"):
        raise UsageError(f"--focal is {focal:g}; give the focal length in pixels.")
    wanted = queries(folder, focal)
    if start is None:
        return BatchPhotos([Unplaced(one.name, one.intrinsics) for one in wanted], [one.photo.resolve() for one in wanted])
    starts = read(start)
    found = match_names([query.name for query in wanted], starts.names, folder.name, starts.source)
    if all(i is None for i in found):
        raise DatasetError(f"'{start.name}' has no start pose for any test photo of '{folder.name}'; give the same scene's.")
    pairs = [(query, i) for query, i in zip(wanted, found, strict=True) if locate or i is not None]
    cameras = [
        Unplaced(query.name, query.intrinsics) if i is None else Camera(query.intrinsics, starts.frames[i].pose, query.name)
        for query, i in pairs
    ]
    what = "are searched for without one" if locate else "are left out"
    said = f"{found.count(None)} of {len(wanted)} test photos have no start pose in '{start.name}' and {what}."
    return BatchPhotos(cameras, [query.photo.resolve() for query, _ in pairs], (said,) if None in found else ())


def _from_cameras(file: Path, start: Path | None, focal: float | None) -> BatchPhotos:
    """Records of a camera file or folder, each with its photo beside that file or in a folder named images near it."""
    read_file = camera_file(file)
    records = read_file.records
    for flag, value in (("--start", start), ("--focal", focal)):
        if value is not None:
            raise UsageError(f"{flag} goes with a data set's folder; '{file.name}' brings its own cameras.")
    for number, record in enumerate(records, 1):
        if not record.file:
            raise UsageError(f"Camera {number} of '{file.name}' names no photo; give it a \"file\".")
    finder, folder = PhotoFinder(file.resolve()), file.resolve() if file.is_dir() else file.resolve().parent
    # A photo that is nowhere is refused when its turn comes.
    photos = [finder.find(record.file) or folder / record.file for record in records]
    cameras, notes = _with_lenses(records, photos)
    return BatchPhotos(cameras, photos, (*read_file.notes, *notes))


def _with_lenses(
    records: Sequence[StartCamera | Unplaced], photos: list[Path]
) -> tuple[list[Camera | Unplaced], tuple[str, ...]]:
    """The cameras, with lenses by their photos where the file tells none, and what was assumed."""
    cameras: list[Camera | Unplaced] = []
    assumed: list[LensGuess | None] = []
    for record, photo in zip(records, photos, strict=True):
        guess = _guess(photo) if record.intrinsics is None else None
        lens, turn = (guess.intrinsics, guess.orientation) if guess else (LENS_OF_UNREADABLE, 1)
        cameras.append(record.camera(lens, turn) if isinstance(record, StartCamera) else record.with_guess(lens))
        assumed += [guess] if record.tells_no_lens else []
    if not assumed:
        return cameras, ()
    by_exif = sum(guess is not None and guess.focal_35mm is not None for guess in assumed)
    said = (
        f"{len(assumed)} of {len(records)} starts tell no lens: {by_exif} get theirs from EXIF, "
        f"{len(assumed) - by_exif} a field of view of {DEFAULT_FOV_DEG:g} degrees across the long side."
    )
    return cameras, (said,)


def _guess(photo: Path) -> LensGuess | None:
    """None for a photo that cannot be read, which is found out when its turn comes."""
    try:
        return guess_lens_of_file(photo)
    except (PhotoError, OSError):
        return None
