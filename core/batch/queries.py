"""What a batch is to do: start cameras with their photos, from a camera file or from a data set's folder."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..cameras import match_names, queries, read
from ..cameras.files import StartCamera, read_starts
from ..cameras.pose_list import checked
from ..errors import DatasetError, PhotoError, UsageError
from ..geometry.camera import Camera, Intrinsics
from ..photos.lens_guess import DEFAULT_FOV_DEG, LensGuess, guess_lens_of_file

# The lens of a photo that cannot be read; the photo is refused when its turn comes.
LENS_OF_UNREADABLE = Intrinsics(1920, 1080, 1920, 1920, 960, 540)


@dataclass(frozen=True)
class BatchPhotos:
    """Start cameras, whose "file" is the photo's name as the source spells it, and as many photo files; `notes` are sentences
    on what was assumed or left out, for whoever asked.
    """

    cameras: list[Camera]
    photos: list[Path]
    notes: tuple[str, ...] = ()


def find_queries(args: argparse.Namespace) -> BatchPhotos:
    """The queries of a batch's flags. Raises UsageError, DatasetError or CameraError."""
    if args.queries.is_dir():
        found = _from_dataset(args.queries, args.start, args.focal)
    else:
        found = _from_cameras(args.queries, args.start, args.focal)
    if args.poses is not None:
        for camera in found.cameras:
            # A name that cannot be written is found before hours of work, not after them.
            checked(camera.file)
    return found


def _from_dataset(folder: Path, start: Path | None, focal: float | None) -> BatchPhotos:
    """Test photos of a scene folder that have a start pose; the others are told and left out."""
    if start is None:
        raise UsageError(f"'{folder.name}' is a data set's folder, which has no start poses; give them with --start POSES.txt.")
    if focal is not None and not 0 < focal < float("inf"):
        raise UsageError(f"--focal is {focal:g}; give the focal length in pixels.")
    wanted, starts = queries(folder, focal), read(start)
    found = match_names([query.name for query in wanted], starts.names, folder.name, starts.source)
    pairs = [(query, starts.frames[i]) for query, i in zip(wanted, found, strict=True) if i is not None]
    if not pairs:
        raise DatasetError(f"'{start.name}' has no start pose for any test photo of '{folder.name}'; give the same scene's.")
    left_out = f"{len(wanted) - len(pairs)} of {len(wanted)} test photos have no start pose in '{start.name}' and are left out."
    cameras = [Camera(query.intrinsics, frame.pose, query.name) for query, frame in pairs]
    return BatchPhotos(cameras, [query.photo.resolve() for query, _ in pairs], (left_out,) if len(pairs) < len(wanted) else ())


def _from_cameras(file: Path, start: Path | None, focal: float | None) -> BatchPhotos:
    """Cameras of a JSON file, each with its photo relative to that file."""
    starts = read_starts(file)
    for flag, value in (("--start", start), ("--focal", focal)):
        if value is not None:
            raise UsageError(f"{flag} goes with a data set's folder; '{file.name}' brings its own cameras.")
    for number, start_camera in enumerate(starts, 1):
        if not start_camera.file:
            raise UsageError(f"Camera {number} of '{file.name}' names no photo; give it a \"file\".")
    photos = [file.resolve().parent / start_camera.file for start_camera in starts]
    cameras, notes = _with_lenses(starts, photos)
    return BatchPhotos(cameras, photos, notes)


def _with_lenses(starts: list[StartCamera], photos: list[Path]) -> tuple[list[Camera], tuple[str, ...]]:
    """The cameras, with lenses by their photos where the file tells none, and what was assumed."""
    cameras: list[Camera] = []
    assumed: list[LensGuess | None] = []
    for start, photo in zip(starts, photos, strict=True):
        guess = _guess(photo) if start.intrinsics is None else None
        cameras.append(start.camera(guess.intrinsics if guess else LENS_OF_UNREADABLE))
        assumed += [guess] if start.intrinsics is None else []
    if not assumed:
        return cameras, ()
    by_exif = sum(guess is not None and guess.focal_35mm is not None for guess in assumed)
    said = (
        f"{len(assumed)} of {len(starts)} starts tell no lens: {by_exif} get theirs from EXIF, "
        f"{len(assumed) - by_exif} a field of view of {DEFAULT_FOV_DEG:g} degrees across the long side."
    )
    return cameras, (said,)


def _guess(photo: Path) -> LensGuess | None:
    """None for a photo that cannot be read, which is found out when its turn comes."""
    try:
        return guess_lens_of_file(photo)
    except (PhotoError, OSError):
        return None
