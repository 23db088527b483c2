"""Several plates tracked in one call: one after the other, each into a file of its own, and none ends the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...cameras.files import load_json
from ...errors import CameraError, GssmcError, UsageError
from ...photos.plate import DIGITS
from ...support.sealed import is_sound
from ...support.words import counted
from ...track import Track
from ...track.file import read_track
from ..console import message, say
from .job import KEY

STATES = ("good", "weak", "lost")
UNUSABLE = "not tracked"
# A number at the end of a movie's name is no frame's.
MOVIES = frozenset({".mov", ".mp4", ".avi", ".mkv", ".m4v", ".mxf", ".webm", ".mpg", ".y4m"})


@dataclass(frozen=True)
class ShotEnd:
    """How a plate ended: its track, or the sentence why there is none; `kept`: it was tracked before."""

    plate: Path
    out: Path
    track: Track | None = None
    sentence: str = ""
    kept: bool = False

    @property
    def verdict(self) -> str:
        return UNUSABLE if self.track is None else self.track.verdict

    @property
    def failed(self) -> bool:
        return self.verdict in (UNUSABLE, "failed")


def out_files(plates: Sequence[Path], folder: Path) -> dict[Path, Path]:
    """The file in `folder` for each plate: its name without the frame's number, with its folder's before it where two have one
    name. Of several files of one sequence the first stands for it. Raises UsageError where two plates would have one file.
    """
    named: dict[tuple[Path, str, str], Path] = {}
    for plate in plates:
        named.setdefault((plate.absolute().parent, _title(plate), plate.suffix), plate)
    titles = Counter(title for _, title, _ in named)
    out: dict[Path, Path] = {}
    for (parent, title, _), plate in named.items():
        file = folder / f"{title if titles[title] == 1 else f'{parent.name}_{title}'}.json"
        other = next((one for one, written in out.items() if written == file), None)
        if other is not None:
            raise UsageError(f"'{other}' and '{plate}' would both be written to '{file}'; track one of them by itself.")
        out[plate] = file
    return out


def _title(plate: Path) -> str:
    if plate.suffix.lower() in MOVIES:
        return plate.stem
    return DIGITS.sub("", plate.stem).rstrip("._- ") or plate.stem


def finished(out: Path, key: str) -> Track | None:
    """The track in a file that was made of the same things, and is as it was written; None where there is none."""
    try:
        data = load_json(out)
        return read_track(out) if isinstance(data, dict) and data.get(KEY) == key and is_sound(data) else None
    except CameraError:
        return None


def track_all(files: dict[Path, Path], track: Callable[[Path, Path], ShotEnd]) -> list[ShotEnd]:
    """Each plate by `track`; one that cannot be tracked is said and ends nothing. KeyboardInterrupt goes through."""
    ends = []
    for number, (plate, out) in enumerate(files.items(), 1):
        message(f"Plate {number} of {len(files)}: '{plate}'.")
        try:
            end = track(plate, out)
        except (GssmcError, OSError) as error:
            end = ShotEnd(plate, out, sentence=" ".join(str(error).split()))
            message(f"'{plate}' was not tracked: {end.sentence}")
        ends.append(end)
    return ends


def say_table(ends: Sequence[ShotEnd]) -> None:
    """A line for each plate, and one for all."""
    names = [end.out.stem for end in ends]
    width = max(map(len, ["plate", *names]))
    say(f"{'plate':{width}}  verdict      good  weak  lost  seconds")
    for name, end in zip(names, ends, strict=True):
        if end.track is None:
            say(f"{name:{width}}  {end.verdict}: {end.sentence}")
            continue
        counts = [sum(frame.state == state for frame in end.track.frames) for state in STATES]
        after = f"{end.track.seconds:7.0f}{'  (tracked before)' if end.kept else ''}"
        say(f"{name:{width}}  {end.verdict:11}  {counts[0]:4}  {counts[1]:4}  {counts[2]:4}  {after}")
    bad = sum(end.failed for end in ends)
    say(f"{len(ends) - bad} of {counted(len(ends), 'plate')} tracked; files in '{ends[0].out.parent}'.")
