"""A moving plate: the frames of a numbered image sequence or of a movie file, read one at a time."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..errors import PhotoError
from ..support.quiet import quiet_opencv
from .containers.exr_header import LARGEST, SMALLEST
from .photo import Photo, read_photo

DIGITS = re.compile(r"(\d+)(?=\D*$)")  # the last number of a file's name
# What OpenCV's FFmpeg opens, and decodes with the help of some graphics cards alone.
UNDECODED = {"av01": "AV1"}


@dataclass(frozen=True)
class Plate:
    """`path`: the movie, or one file of the sequence. Frames go by number: of a movie from 1, of a sequence as in its names."""

    path: Path
    is_movie: bool

    def file(self, number: int) -> Path:
        """The file that holds the frame. Raises PhotoError when the name has no number to count with."""
        if self.is_movie:
            return self.path
        found = DIGITS.search(self.path.stem)
        if not found:
            raise PhotoError(f"The name '{self.path.name}' has no number; the files of a sequence must be numbered.")
        digits = f"{number:0{len(found.group())}d}"
        stem = self.path.stem
        return self.path.with_name(f"{stem[: found.start()]}{digits}{stem[found.end() :]}{self.path.suffix}")

    def read(self, number: int) -> Photo:
        """The frame. Raises PhotoError when there is none."""
        return _read_movie(self.path, number) if self.is_movie else read_photo(self.file(number))


def open_plate(path: str | Path) -> tuple[Plate, int, int]:
    """The plate that a file belongs to, with its first and last frame. Raises PhotoError when it is no plate.

    A sequence goes as far as its numbers have no gap around the given file.
    """
    path = Path(path)
    if not path.is_file():
        raise PhotoError(f"There is no file at '{path}'; choose a movie, or an image of a numbered sequence.")
    count = _movie_frames(path)
    if count > 0:
        return Plate(path, True), 1, count
    plate = Plate(path, False)
    found = DIGITS.search(path.stem)
    if not found:
        raise PhotoError(f"'{path.name}' is neither a movie nor an image with a number in its name.")
    first = last = int(found.group())
    while first > 0 and plate.file(first - 1).is_file():
        first -= 1
    while plate.file(last + 1).is_file():
        last += 1
    return plate, first, last


def _pixel_aspect(movie: cv2.VideoCapture) -> float:
    """How wide a pixel is shown, in its heights."""
    across, down = movie.get(cv2.CAP_PROP_SAR_NUM), movie.get(cv2.CAP_PROP_SAR_DEN)
    ratio = across / down if across > 0 and down > 0 else 1.0
    return ratio if SMALLEST <= ratio <= LARGEST else 1.0


def number_of(file: str) -> int | None:
    """The frame's number in the name of a sequence's file; None where it has none."""
    found = DIGITS.search(Path(file).stem)
    return int(found.group()) if found else None


def behind_gaps(plate: Plate, first: int, last: int) -> list[int]:
    """The numbers of a sequence's files before `first` or behind `last`, from which a missing file parts them."""
    found = DIGITS.search(plate.path.stem)
    if plate.is_movie or found is None:
        return []
    start, end = plate.path.stem[: found.start()], plate.path.stem[found.end() :] + plate.path.suffix
    names = (file.name for file in plate.path.parent.iterdir() if file.name.startswith(start) and file.name.endswith(end))
    numbers = (name[len(start) : len(name) - len(end)] for name in names)
    return sorted(n for n in (int(text) for text in numbers if text.isdigit()) if not first <= n <= last)


def _movie_frames(path: Path) -> int:
    """How many frames a movie has; 0 for what is none (OpenCV opens numbered images as movies too, hence the suffixes)."""
    if path.suffix.lower() in {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".exr", ".bmp"}:
        return 0
    with quiet_opencv():
        movie = cv2.VideoCapture(str(path))
    try:
        return int(movie.get(cv2.CAP_PROP_FRAME_COUNT)) if movie.isOpened() else 0
    finally:
        movie.release()


def _codec(movie: cv2.VideoCapture) -> str:
    """The four characters that name how the movie is coded."""
    number = int(movie.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
    return number.to_bytes(4, "little").decode("latin-1").lower()


def _read_movie(path: Path, number: int) -> Photo:
    if not path.is_file():
        raise PhotoError(f"There is no movie at '{path}'; check the path.")
    with quiet_opencv():
        movie = cv2.VideoCapture(str(path))
    try:
        if not movie.isOpened():
            raise PhotoError(f"The movie '{path.name}' cannot be opened; convert it to an image sequence.")
        if number < 1 or not movie.set(cv2.CAP_PROP_POS_FRAMES, number - 1):
            raise PhotoError(f"The movie '{path.name}' has no frame {number}.")
        count, coded = int(movie.get(cv2.CAP_PROP_FRAME_COUNT)), _codec(movie)
        aspect = _pixel_aspect(movie)
        with quiet_opencv():
            ok, frame = movie.read()
    finally:
        movie.release()
    pixels: Any = frame
    if not ok or pixels is None or pixels.ndim != 3:
        if number <= count and coded in UNDECODED:
            raise PhotoError(
                f"The movie '{path.name}' is coded as {UNDECODED[coded]}, which cannot be decoded here; convert it to H.264 or "
                "to an image sequence."
            )
        raise PhotoError(f"The movie '{path.name}' has no frame {number}.")
    return Photo(np.ascontiguousarray(pixels[..., 2::-1]), str(path), pixel_aspect=aspect)
