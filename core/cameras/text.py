"""Text files of numbers, read so that a damaged, binary or endless file ends in one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..errors import CameraError, DatasetError
from ..geometry.camera import Pose
from ..geometry.quaternion import rotation_from_quaternion

# A line of a COLMAP image with half a million points has that size. A longer line is not of a text file.
MAX_LINE_BYTES = 1 << 24
# The square of a larger number would not be exact enough to be compared.
LARGEST = 1e12
HEAD_BYTES = 1 << 16
POSE_COLUMNS = "qw qx qy qz tx ty tz"


def read_lines(path: Path) -> Iterator[tuple[int, str]]:
    """(number from 1, text without the line's end) of each line. Raises DatasetError when the file is no readable text."""
    try:
        with path.open("rb") as file:
            number = 0
            while line := file.readline(MAX_LINE_BYTES):
                number += 1
                if len(line) == MAX_LINE_BYTES or b"\0" in line:
                    raise DatasetError(f"'{path.name}' is no text file (line {number}); give a file of poses.")
                yield number, line.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r\n")
    except FileNotFoundError:
        raise DatasetError(f"There is nothing at '{path}'; check the path.") from None
    except UnicodeDecodeError:
        raise DatasetError(f"'{path.name}' is no text file (it is not UTF-8); give a file of poses.") from None
    except OSError as error:
        raise DatasetError(f"'{path}' cannot be read ({error.strerror}); check the path.") from error


def data_lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    """("line N of 'file'", columns) of every line that is neither blank nor a # comment."""
    for number, line in read_lines(path):
        columns = line.split()
        if columns and not columns[0].startswith("#"):
            yield f"Line {number} of '{path.name}'", columns


def head(path: Path) -> str:
    """The beginning of a file, for telling layouts apart; empty when it cannot be read or is no text."""
    try:
        with path.open("rb") as file:
            start = file.read(HEAD_BYTES)
    except OSError:
        return ""
    return "" if b"\0" in start else start.decode("utf-8-sig", errors="replace")


def numbers(columns: Sequence[str], where: str, what: str) -> list[float]:
    """Numbers, finite and of a sane size. `what` names the columns in the DatasetError's sentence."""
    try:
        values = [math.nan if "_" in column else float(column) for column in columns]  # Python reads 1_0 as 10
    except ValueError:
        values = [math.nan]
    return usable_numbers(values, where, what)


def usable_numbers(values: list[float], where: str, what: str) -> list[float]:
    """`values`, which must be finite and of a sane size, as `numbers` says."""
    if not all(abs(value) <= LARGEST for value in values):  # false for NaN
        raise DatasetError(f"{where} has a value that is no usable number; it should hold {what}.")
    return values


def pose_from_columns(columns: Sequence[str], where: str) -> Pose:
    """The world-to-camera pose written as qw qx qy qz tx ty tz. Raises DatasetError."""
    return pose_from_numbers(numbers(columns, where, POSE_COLUMNS), where)


def pose_from_numbers(values: Sequence[float], where: str) -> Pose:
    """The world-to-camera pose of the 7 numbers qw qx qy qz tx ty tz. Raises DatasetError."""
    try:
        return Pose(rotation_from_quaternion(values[:4]), values[4:])  # type: ignore[arg-type]
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None
