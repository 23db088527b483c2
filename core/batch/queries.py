"""What a batch is to do: start cameras with their photos, from a camera file or from a data set's folder."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..cameras import camera_file, detect, has_queries, match_names, queries, read
from ..cameras.files import StartCamera, parse_file
from ..cameras.pose_list import checked
from ..cameras.unplaced import Unplaced, wanted_from_dict
from ..errors import CameraError, DatasetError, PhotoError, UsageError
from ..geometry.camera import Camera
from ..photos.lens_guess import DEFAULT_FOV_DEG, LensGuess, guess_lens_of_file
from ..photos.places import PhotoFinder
from ..support.picture_names import PICTURES
from ..support.words import counted
from .keys import Refused

Query = Camera | Unplaced | Refused


@dataclass(frozen=True)
class BatchPhotos:
    """Start cameras, or lenses of photos without a start, or records that cannot be used, whose "file" is the photo's name as
    the source spells it, and as many photo files; `notes` are sentences on what was assumed or left out, for whoever asked.
    """

    cameras: list[Query]
    photos: list[Path]
    notes: tuple[str, ...] = ()


def find_queries(args: argparse.Namespace) -> BatchPhotos:
    """The queries of a batch's flags; `args.locate` tells whether photos without a start are found as well.

    A record that cannot be used is Refused, by itself. Raises UsageError or DatasetError, and CameraError where no record can.
    """
    given = args.start is not None or args.focal is not None
    _refuse_photos_alone(args.queries)
    if args.queries.is_dir() and (given or has_queries(args.queries)):
        found = _from_dataset(args.queries, args.start, args.focal, args.locate)
    else:
        found = _from_cameras(args.queries, args.start, args.focal, args.locate)
    if args.poses is not None:
        for camera in found.cameras:
            # A name that cannot be written is found before hours of work, not after them.
            if not isinstance(camera, Refused):
                checked(camera.file)
    return found


def _refuse_photos_alone(source: Path) -> None:
    """Raises UsageError where the source is a folder of photos, without a word of which of them are meant."""
    if source.is_dir() and detect(source) is None:
        names = sorted(path.name for path in source.iterdir() if path.suffix.lower() in PICTURES)
        if names:
            frames = json.dumps({"frames": names[:2]}, ensure_ascii=False)
            raise UsageError(
                f"'{source}' is a folder of photos; name those that are meant in a JSON file there, as in {frames}."
            )


def _from_dataset(folder: Path, start: Path | None, focal: float | None, locate: bool) -> BatchPhotos:
    """Test photos of a scene folder. Those without a start pose have to be found, or are left out, and that is said."""
    if start is None and not locate:
        raise UsageError(f"'{folder.name}' is a data set's folder, which has no start poses; give them with --start POSES.txt.")
    if focal is not None and not 0 < focal < float("inf"):
        raise UsageError(f"--focal is {focal:g}; give the focal length in pixels.")
    wanted = queries(folder, focal)
    if start is None:
        unplaced: list[Query] = [Unplaced(one.name, one.intrinsics) for one in wanted]
        return BatchPhotos(unplaced, [one.photo.resolve() for one in wanted])
    starts = read(start)
    found = match_names([query.name for query in wanted], starts.names, folder.name, starts.source)
    if all(i is None for i in found):
        raise DatasetError(f"'{start.name}' has no start pose for any test photo of '{folder.name}'; give the same scene's.")
    pairs = [(query, i) for query, i in zip(wanted, found, strict=True) if locate or i is not None]
    cameras: list[Query] = [
        Unplaced(query.name, query.intrinsics) if i is None else Camera(query.intrinsics, starts.frames[i].pose, query.name)
        for query, i in pairs
    ]
    lacking = f"{found.count(None)} of {counted(len(wanted), 'test photo')}"
    what = "searched for" if locate else "left out"
    note = f"'{start.name}' has no start pose for {lacking}; without one, a photo is {what}."
    return BatchPhotos(cameras, [query.photo.resolve() for query, _ in pairs], (note,) if None in found else ())


def _from_cameras(file: Path, start: Path | None, focal: float | None, locate: bool) -> BatchPhotos:
    """Records of a camera file or folder, each with its photo beside it or in a folder named images near it. Raises CameraError
    when none of them can be used.
    """
    records, notes = _records(file, locate)
    for flag, value in (("--start", start), ("--focal", focal)):
        if value is not None:
            raise UsageError(f"{flag} goes with a data set's folder; '{file.name}' brings its own cameras.")
    refused = [record for record in records if isinstance(record, Refused)]
    if len(refused) == len(records):
        raise CameraError(refused[0].sentence)
    finder, folder = PhotoFinder(file.resolve()), file.resolve() if file.is_dir() else file.resolve().parent
    # A photo that is nowhere is refused when its turn comes.
    photos = [finder.find(record.file) or folder / record.file for record in records]
    found = _with_lenses(records, photos)
    return replace(found, notes=(*notes, *found.notes))


def _records(file: Path, locate: bool) -> tuple[Sequence[StartCamera | Unplaced | Refused], tuple[str, ...]]:
    """The records of a file, and sentences on what of another layout than ours is left out."""
    if file.exists() and detect(file) not in (None, "cameras"):
        found = camera_file(file)
        return found.records, found.notes
    return parse_file(file, partial(_record, locate=locate)), ()


def _record(data: Any, name: str, locate: bool) -> StartCamera | Unplaced | Refused:
    """The record in a JSON value, Refused where its photo cannot be tried; `name` begins the sentence."""
    try:
        wanted = wanted_from_dict(data, name)
    except CameraError as error:
        file = data.get("file") if isinstance(data, dict) else ""
        return Refused(Unplaced(file if isinstance(file, str) and _can_be_a_file(file) else ""), str(error))
    if not wanted.file or not _can_be_a_file(wanted.file):
        return Refused(replace(wanted, file=""), f'{name} names no photo; give it a "file".')
    if isinstance(wanted, Unplaced) and not locate:
        return Refused(wanted, f"{name} has no R and t; give a start, or leave out --no-locate.")
    return wanted


def _can_be_a_file(name: str) -> bool:
    """Whether the system could have a file of that name: JSON holds characters that no name has."""
    try:
        return b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:
        return False


def _with_lenses(records: Sequence[StartCamera | Unplaced | Refused], photos: list[Path]) -> BatchPhotos:
    """The cameras, with lenses by their photos where the file tells none, and what was assumed. A photo that cannot be read
    gives no lens, so that its record is refused here.
    """
    cameras: list[Query] = []
    assumed: list[LensGuess] = []
    for record, photo in zip(records, photos, strict=True):
        if isinstance(record, Refused):
            cameras.append(record)
            continue
        try:
            guess = guess_lens_of_file(photo) if record.intrinsics is None else None
            cameras.append(_with_lens(record, guess))
        except (PhotoError, CameraError) as error:
            cameras.append(Refused(record, str(error)))
            continue
        assumed += [guess] if guess and record.tells_no_lens else []
    if not assumed:
        return BatchPhotos(cameras, photos)
    by_exif = sum(guess.focal_35mm is not None for guess in assumed)
    note = (
        f"No lens is given for {len(assumed)} of {counted(len(records), 'photo')}: it is EXIF's for {by_exif}, "
        f"and {DEFAULT_FOV_DEG:g} degrees across the long side for {len(assumed) - by_exif}."
    )
    return BatchPhotos(cameras, photos, (note,))


def _with_lens(record: StartCamera | Unplaced, guess: LensGuess | None) -> Camera | Unplaced:
    lens = record.intrinsics or (guess.intrinsics if guess else None)
    assert lens is not None
    turn = guess.orientation if guess else 1
    return record.camera(lens, turn) if isinstance(record, StartCamera) else record.with_guess(lens)
