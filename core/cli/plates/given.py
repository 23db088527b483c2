"""What the flags of `track` say of frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...cameras import camera_file
from ...cameras.names import name_key
from ...errors import UsageError
from ...photos.plate import Plate, behind_gaps
from ...support.picture_names import file_name
from ...support.words import counted
from ..console import message


def frames_of(text: str | None, plate: Plate, first: int, last: int) -> range:
    """The frames that A-B names, all from `first` to `last` where nothing is named; a range may reach over gaps of a sequence,
    whose frames are lost then. Says which files are left out, or missing. Raises UsageError.
    """
    beyond = behind_gaps(plate, first, last)
    if text is None:
        _say_left_out(beyond, first, last)
        return range(first, last + 1)
    a, dash, b = text.partition("-")
    if not (a.isdigit() and (b.isdigit() or not dash)):
        raise UsageError(f"--frames is '{text}'; give the first and the last frame, such as {first}-{last}.")
    low, high = int(a), int(b) if dash else int(a)
    if low > high:
        raise UsageError(f"--frames is {text}, which ends before it begins; exchange the two.")
    lowest, highest = min([first, *beyond]), max([last, *beyond])
    if not lowest <= low <= high <= highest:
        raise UsageError(f"--frames is {text}, but the plate has the frames {lowest} to {highest}.")
    there = {*range(first, last + 1), *beyond}
    missing = [frame for frame in range(low, high + 1) if frame not in there]
    if missing:
        message(f"Of the plate, {counted(len(missing), 'frame')} missing: {_listed(missing)}.")
    return range(low, high + 1)


def _say_left_out(beyond: Sequence[int], first: int, last: int) -> None:
    if beyond:
        lie = "lies behind a gap and is" if len(beyond) == 1 else "lie behind a gap and are"
        files = f"{counted(len(beyond), 'file')} of the sequence, from {beyond[0]} to {beyond[-1]}"
        missing = [frame for frame in range(min(beyond[0], first), max(beyond[-1], last)) if frame not in beyond]
        missing = [frame for frame in missing if not first <= frame <= last]
        gaps = f"missing: {_listed(missing)}; --frames {min(beyond[0], first)}-{max(beyond[-1], last)} takes all"
        message(f"The plate's frames are {first} to {last}; {files}, {lie} left out ({gaps}).")


def _listed(frames: Sequence[int]) -> str:
    """Frame numbers, runs of them as A-B."""
    runs: list[list[int]] = []
    for frame in frames:
        if runs and frame == runs[-1][-1] + 1:
            runs[-1] = [runs[-1][0], frame]
        else:
            runs.append([frame])
    return ", ".join("-".join(map(str, run)) for run in runs)


def camera_files(flag: str, given: Sequence[str], frames: range, plate: Plate) -> dict[int, Path]:
    """The camera files by frame of a flag that is given as FRAME=FILE, or as FILE alone: then of the frames that its cameras
    name. Raises UsageError, CameraError.
    """
    out: dict[int, Path] = {}
    for text in given:
        frame, equals, file = text.partition("=")
        if not equals and Path(text).exists():
            named = _named(Path(text), frames, plate)
        elif frame.isdigit() and file:
            named = [int(frame)]
        else:
            raise UsageError(f"{flag} is '{text}'; give a frame and a camera file, such as {frames[0]}=CAMERA.json.")
        for number in named:
            if number not in frames:
                raise UsageError(f"{flag} names frame {number}, which is not among {frames[0]} to {frames[-1]}.")
            if number in out:
                raise UsageError(f"{flag} names frame {number} twice; give one camera for it.")
            out[number] = Path(file or text)
    return out


def _named(file: Path, frames: range, plate: Plate) -> list[int]:
    """The frames of which a camera file has the camera by the name of their file."""
    records = camera_file(file).records
    names = {name_key(file_name(record.file)) for record in records if record.file}
    return [frame for frame in frames if not plate.is_movie and name_key(plate.file(frame).name) in names]
