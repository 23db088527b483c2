"""The end of a command: its results as JSON, and lines for people and for whoever reads the exit code."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from ..batch.records import UNUSABLE, KeptRecords
from ..cameras import pose_list, short
from ..cameras.files import camera_from_dict
from ..support.atomic import atomic_write
from ..support.words import counted
from .console import message, say
from .outcome import FAILED_VERDICT, OK, has_camera

ENDINGS = ("trusted", "check", "failed", UNUSABLE)
EXIT_ZERO_HELP = "exit code 0 also when photos failed, for farms that take any other for a machine's failure"
LISTED = 10  # photos that are named when a batch ends


def put_result(out: Path | None, record: dict[str, Any]) -> None:
    """Writes the record to `out` and says one line of it, or says the whole where there is no `out`. Raises OSError."""
    text = json.dumps(record, indent=1)
    if out is None:
        say(text)
        message(summary(record))
        return
    write_json(out, record)
    say(summary(record))


def write_json(out: Path, data: dict[str, Any]) -> None:
    """Writes `data` in one step. Raises OSError, after it said it: what was found is not lost."""
    text = json.dumps(data, indent=1)
    try:
        with atomic_write(out) as file:
            file.write(text + "\n")
    except OSError:
        say(text)
        raise


def summary(record: dict[str, Any]) -> str:
    """One line for people."""
    if record["verdict"] == "pinned":
        return " ".join(record["reasons"])
    after = f"after {counted(len(record['iterations']), 'iteration')}, {record['seconds']:.1f} s"
    return f"{record['verdict']} {after}. {' '.join(record['reasons'])}"


def say_endings(records: KeptRecords, out: Path) -> int:
    """Says how many photos ended how, and names those that are lost; the exit code."""
    _say_lost(records, out)
    counts = records.endings
    endings = [ending for ending in ENDINGS if ending != UNUSABLE or counts[ending]]
    say(", ".join(f"{counts[ending]} {ending}" for ending in endings) + f"; results in {out}")
    return FAILED_VERDICT if counts["failed"] or counts[UNUSABLE] else OK


def write_poses(path: Path, records: KeptRecords) -> None:
    """A line for each photo that has a pose and was tried. Raises OSError."""
    tried = ((index, gist) for index in sorted(records) if (gist := records.gist(index)) is not None)
    placed = (records[index] for index, gist in tried if gist.placed and gist.ending != UNUSABLE)
    cameras = (camera_from_dict(record) for record in placed if has_camera(record))
    pose_list.write(path, [(camera.file, camera.pose) for camera in cameras])


def _say_lost(records: KeptRecords, out: Path) -> None:
    """Tells which photos failed or could not be used, and why; of many the first."""
    gists = [(index, gist) for index in sorted(records) if (gist := records.gist(index)) is not None]
    lost = [index for index, gist in gists if gist.ending in ("failed", UNUSABLE)]
    for index in lost[:LISTED]:
        record = records[index]
        ending = "failed" if "error" not in record else "could not be used"
        name = f"'{short(record['file'])}' {ending}: " if record["file"] else ""
        message(f"{name}{' '.join(record['reasons'][0].split())}")
    if len(lost) > LISTED:
        message(f"... and {len(lost) - LISTED} more in '{out}'.")
    told = Counter(sentence for _, gist in gists for sentence in gist.taken)
    for sentence, count in told.items():
        message(sentence if count == 1 else f"In {count} of {counted(len(records), 'photo')}: {sentence}")
    nowhere = sum(not gist.placed and gist.ending != UNUSABLE for _, gist in gists)
    if nowhere:
        be, have = ("was", "it has") if nowhere == 1 else ("were", "they have")
        message(f"{nowhere} of {counted(len(records), 'photo')} had no start and {be} not found, so {have} no pose.")
