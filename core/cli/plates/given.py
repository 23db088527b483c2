"""What the flags of `track` say of frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...errors import UsageError
from ...photos.plate import Plate, behind_gaps
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


def camera_files(flag: str, given: Sequence[str], frames: range) -> dict[int, Path]:
    """The camera files of a flag that is given as FRAME=FILE, by frame. Raises UsageError."""
    out = {}
    for text in given:
        frame, equals, file = text.partition("=")
        if not (frame.isdigit() and equals and file):
            raise UsageError(f"{flag} is '{text}'; give a frame and a camera file, such as {frames[0]}=CAMERA.json.")
        if int(frame) not in frames:
            raise UsageError(f"{flag} names frame {frame}, which is not among {frames[0]} to {frames[-1]}.")
        if int(frame) in out:
            raise UsageError(f"{flag} names frame {frame} twice; give one camera for it.")
        out[int(frame)] = Path(file)
    return out
