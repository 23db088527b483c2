"""The commands that are tried: how each is called in a trial's folder, and what it leaves that has to be right."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from samples import FEW, LENSES, MAP, SCAN, START_FRAME, STARTS, VIEWS

from core.locate.cache import SUFFIX

QUICK = ["--long-side-px", "240", "--iterations", "1", "--candidates", "2"]
STUB_S = 0.15
UNSTEADY = ("seconds", "key", "sum")  # what differs from one run to the next

Answers = dict[str, Any]


@dataclass(frozen=True)
class Tried:
    """A command.

    `arguments` in a trial's folder; `answers` reads there what the command finished, `kept` also what one that was killed did;
    `stub`: the engine is replaced by one that takes STUB_S a photo; `blender`: it is a script for Python with Blender as a
    module; `memory_mb`: too little address space, and enough of it, for a process.
    """

    name: str
    arguments: Callable[[Path], list[str]]
    out: str
    answers: Callable[[Path], Answers]
    kept: Callable[[Path], Answers]
    stub: bool = False
    blender: bool = False
    memory_mb: tuple[int, int] = (150, 520)

    @property
    def engine(self) -> str:
        return "stub" if self.stub else "real"


def steady(value: Any, folder: Path) -> Any:
    """The value without what differs between two runs."""
    if isinstance(value, dict):
        return {name: steady(one, folder) for name, one in value.items() if name not in UNSTEADY}
    if isinstance(value, list):
        return [steady(one, folder) for one in value]
    return value.replace(str(folder), "") if isinstance(value, str) else value


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def _frames(path: Path) -> Answers:
    data = _json(path)
    return {frame["file"]: frame for frame in data["frames"]} if isinstance(data, dict) else {}


def batch_answers(folder: Path) -> Answers:
    return _frames(folder / "out" / "r.json")


def batch_kept(folder: Path) -> Answers:
    """Finished photos on disk, read without the engine's help: those of the results, and behind them the journal's."""
    found = {name: frame for name, frame in batch_answers(folder).items() if "error" not in frame}
    journal = folder / "out" / "r.json.journal"
    for line in journal.read_bytes().split(b"\n")[1:] if journal.exists() else []:
        try:
            frame = json.loads(line)
        except ValueError:
            continue
        if "error" not in frame:
            found[frame["file"]] = frame
    return found


def result_answers(folder: Path) -> Answers:
    data = _json(folder / "out" / "r.json")
    return {} if data is None else {"result": data}


def map_answers(folder: Path) -> Answers:
    """The arrays of the map, beside the scan or, where that could not be written, in the user's cache."""
    paths = [folder / "in" / MAP, *(folder / "cache").rglob(f"*{SUFFIX}")]
    path = next((path for path in paths if path.exists()), None)
    if path is None:
        return {}
    with np.load(path, allow_pickle=False) as arrays:
        return {name: hashlib.sha256(arrays[name].tobytes()).hexdigest() for name in arrays.files}


def _batch(queries: str, *more: str) -> Callable[[Path], list[str]]:
    def arguments(folder: Path) -> list[str]:
        files = [str(folder / "in" / SCAN), str(folder / "in" / queries), "--out", str(folder / "out" / "r.json")]
        return ["batch", *files, "--workers", "2", "--views", str(VIEWS), *QUICK, *more]

    return arguments


def _locate(folder: Path) -> list[str]:
    files = [str(folder / "in" / SCAN), str(folder / "in" / "plate.1002.png"), "--out", str(folder / "out" / "r.json")]
    return ["locate", *files, "--views", str(VIEWS), *QUICK]


def _map(folder: Path) -> list[str]:
    return ["map", str(folder / "in" / SCAN), "--views", str(VIEWS)]


def _track(folder: Path) -> list[str]:
    files = [str(folder / "in" / SCAN), str(folder / "in" / "plate.1001.png"), "--out", str(folder / "out" / "r.json")]
    start = f"{START_FRAME}={folder / 'in' / 'start.json'}"
    return ["track", *files, "--start", start, "--no-locate", "--track-long-side", "240", *QUICK]


def _blender(action: str) -> Callable[[Path], list[str]]:
    return lambda folder: [str(Path(__file__).with_name("inside_blender.py")), action, str(folder)]


def _exported(folder: Path) -> Answers:
    file = folder / "out" / "s.ply"
    return {"splats": hashlib.sha256(file.read_bytes()).hexdigest()} if file.exists() else {}


def _nothing(folder: Path) -> Answers:
    return {}


COMMANDS = {
    one.name: one
    for one in (
        Tried("batch", _batch(STARTS), "r.json", batch_answers, batch_kept, stub=True),
        Tried("batch, finding", _batch(LENSES), "r.json", batch_answers, batch_kept, stub=True),
        Tried("batch, whole", _batch(FEW), "r.json", batch_answers, batch_kept),
        Tried("locate", _locate, "r.json", result_answers, _nothing),
        Tried("map", _map, "", map_answers, _nothing),
        Tried("track", _track, "r.json", result_answers, _nothing),
    )
}
BLENDER_MB = (1000, 4000)
JOBS = {
    one.name: one
    for one in (
        Tried("Blender: refine", _blender("refine"), "r.json", result_answers, _nothing, blender=True, memory_mb=BLENDER_MB),
        Tried("Blender: find", _blender("find"), "r.json", result_answers, _nothing, blender=True, memory_mb=BLENDER_MB),
        Tried("Blender: export", _blender("export"), "s.ply", _exported, _nothing, blender=True, memory_mb=BLENDER_MB),
    )
}
