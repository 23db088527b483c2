"""Faults in long work, as a campaign: commands are killed, starved and lied to, and nothing that was finished may be lost.

    python benchmarks/faults [--seed 0] [--only KIND] [--command NAME] [--log LOG.jsonl] [--scale 1] [--table]
    python benchmarks/faults --blender

Each trial runs a command on the built-in sample at a small size, in a folder of its own; "stub" marks those whose engine is
replaced by one that answers at once, because its own time is not what is tried. After the fault no finished photo may be lost,
every answer on disk must be that of an undisturbed run, no process, temporary file or lock may be left, and the same command
must complete. With --log, trials that stand there are not repeated. The faults of disks need the right to mount a tmpfs.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import subprocess
import sys
import tempfile
import time
import traceback
import zlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).resolve().parent)]

import numpy as np
import stored
from commands import COMMANDS, JOBS, Tried
from kinds import KINDS, replaced
from plan import BLENDER_PLAN, PLAN
from samples import OTHER, SCAN, Samples, make_samples
from trial import Faulted, Undisturbed, undisturbed

TRIED: dict[str, Tried] = {**COMMANDS, **JOBS}
NO_ENGINE = "none"
STORED = 100  # damages of each file that is read in this process


class Campaign:
    """Runs trials and keeps what came of each: in a file, a JSON record a line, where one is given."""

    def __init__(self, seed: int, folder: Path, log: Path | None) -> None:
        self._seed, self._folder, self._log = seed, folder, log
        self.samples: Samples = make_samples(folder / "samples")
        self._known: dict[tuple[str, bool], Undisturbed] = {}
        lines = log.read_text().splitlines() if log and log.exists() else []
        self.done = {(one["kind"], one["command"], one["number"]): one for one in map(json.loads, lines)}

    def _undisturbed(self, command: str, other: bool = False) -> Undisturbed:
        def exchange(trial: Faulted) -> None:
            (trial.folder / "in" / SCAN).write_bytes((self.samples.folder / OTHER).read_bytes())

        if (command, other) not in self._known:
            prepare = exchange if other else None
            self._known[command, other] = undisturbed(TRIED[command], self._folder / "known", self.samples, prepare)
            self.said(f"undisturbed, {command}: {self._known[command, other].seconds:.1f} s")
        return self._known[command, other]

    def trial(self, kind: str, command: str, number: int) -> None:
        if (kind, command, number) in self.done:
            return
        rng = np.random.default_rng([self._seed, zlib.crc32(f"{kind} {command}".encode()), number])
        trial = Faulted(TRIED[command], self._folder / "trial", self.samples, rng, self._undisturbed(command))
        began = time.monotonic()
        try:
            if kind == "scan replaced" and command in COMMANDS and COMMANDS[command].stub:
                replaced(trial, self._undisturbed(command, other=True))
            else:
                KINDS[kind](trial)
        except Exception as error:  # noqa: BLE001 - a trial that breaks down is one that was not survived
            trial.broken.append(f"{type(error).__name__}: {str(error)[:300]} {traceback.format_exc()[-300:]}")
        trial.remove()
        seconds = time.monotonic() - began
        self.put(kind, command, number, trial.broken, trial.struck, TRIED[command].engine)
        self.said(f"{kind}, {command}, {number}: {'; '.join(trial.broken) or 'survived'} ({seconds:.0f} s)")

    def put(self, kind: str, command: str, number: int, broken: list[str], struck: bool, engine: str) -> None:
        one = {"kind": kind, "command": command, "number": number, "broken": broken, "struck": struck, "engine": engine}
        self.done[kind, command, number] = one | {"seed": self._seed, "commit": _commit()}
        if self._log is not None:
            with self._log.open("a") as file:
                file.write(json.dumps(self.done[kind, command, number]) + "\n")

    @staticmethod
    def said(text: str) -> None:
        sys.stderr.write(f"{time.strftime('%H:%M:%S')} {text}\n")

    def stored(self) -> None:
        """Damages of stored files, read in this process."""
        folder = self._folder / "stored"
        track = self._folder / "track"
        makers = {
            "results of batch": lambda at: stored.batch_file(at, "r.json"),
            "journal of batch": lambda at: stored.batch_file(at, "r.json.journal"),
            "map of a scan": lambda at: stored.map_file(at, self.samples),
            "journal of track": lambda at: stored.track_journal(at, *stored.interrupted_track(track, self.samples)),
            "TRACK.json": lambda at: stored.track_file(at, stored.whole_track(track, self.samples)),
        }
        logging.disable(logging.CRITICAL)
        for name, make in makers.items():
            if ("bytes damaged", name, STORED - 1) not in self.done:
                for number, broken in enumerate(stored.run(make, folder, self._seed, STORED)):
                    self.put("bytes damaged", name, number, broken, True, NO_ENGINE)
                self.said(f"bytes damaged, {name}")


def _commit() -> str:
    asked = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False)
    return asked.stdout.strip()


def table(done: list[dict]) -> Iterator[str]:
    """A row for each kind of fault, with how many trials of each command were survived; below, the rules that were broken."""
    names = [name for name in TRIED if any(one["command"] == name for one in done)]
    columns = [f"{name}{' (stub)' if TRIED[name].stub else ''}" for name in names] + ["stored files"]
    yield f"| fault | tried | struck while it ran | survived | lost | {' | '.join(columns)} |"
    yield "|---" * (5 + len(columns)) + "|"
    kinds = {one["kind"]: [other for other in done if other["kind"] == one["kind"]] for one in done}
    for kind, of in [*sorted(kinds.items()), ("all", done)]:
        cells = [_cell([one for one in of if one["command"] == name and one["engine"] != NO_ENGINE]) for name in names]
        cells.append(_cell([one for one in of if one["engine"] == NO_ENGINE]))
        lost = sum(bool(one["broken"]) for one in of)
        struck = sum(one["struck"] for one in of)
        yield f"| {kind} | {len(of)} | {struck} | {len(of) - lost} | {lost} | {' | '.join(cells)} |"
    for one in done:
        for broken in one["broken"]:
            yield f"\n{one['kind']}, {one['command']}, number {one['number']}: {broken}"


def _cell(of: list[dict]) -> str:
    return f"{sum(not one['broken'] for one in of)} / {len(of)}" if of else ""


def _install(folder: Path) -> None:
    """The extension, built from this tree, in a fresh user's folder of Blender's."""
    build = [sys.executable, str(ROOT / "tools" / "build_extension.py"), "--no-wheels", "--out", str(folder / "dist")]
    subprocess.run(build, check=True, capture_output=True)
    os.environ["BLENDER_USER_RESOURCES"] = str(folder / "blender")
    os.environ["GSSMC_ZIP"] = str(next((folder / "dist").glob("gssmc-*.zip")))
    script = Path(__file__).with_name("inside_blender.py")
    subprocess.run([sys.executable, str(script), "install", str(folder)], check=True, capture_output=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--only", choices=[*KINDS, "stored"], help="one kind of fault; stored: damaged files, read in this process"
    )
    parser.add_argument("--command", choices=[*COMMANDS, *JOBS])
    parser.add_argument("--log", type=Path)
    parser.add_argument("--scale", type=float, default=1.0, help="so many times the trials of the plan")
    parser.add_argument("--table", action="store_true", help="only print the table of the log")
    parser.add_argument("--blender", action="store_true", help="jobs inside Blender, in place of commands")
    options = parser.parse_args()
    if options.table:
        print("\n".join(table([json.loads(line) for line in options.log.read_text().splitlines()])))
        return 0
    with tempfile.TemporaryDirectory(prefix="gssmc-faults-") as folder:
        campaign = Campaign(options.seed, Path(folder), options.log)
        if options.blender:
            _install(Path(folder))
        elif options.only in (None, "stored") and options.command is None:
            campaign.stored()
        plan, tried = (BLENDER_PLAN, JOBS) if options.blender else (PLAN, COMMANDS)
        counted = [(kind, name, n) for kind, of in plan.items() for name, n in zip(tried, of, strict=True)]
        chosen = [(kind, command, round(options.scale * count)) for kind, command, count in counted]
        for number in range(max(count for _, _, count in chosen)):
            for kind, command, count in chosen:
                if number < count and options.only in (None, kind) and options.command in (None, command):
                    campaign.trial(kind, command, number)
        print("\n".join(table(list(campaign.done.values()))))
        return 1 if any(one["broken"] for one in campaign.done.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
