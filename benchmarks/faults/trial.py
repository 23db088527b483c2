"""One trial: a command in a folder of its own, started, hurt, and started again; and the rules that it must keep."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from commands import STUB_S, UNSTEADY, Answers, Tried, steady
from samples import MAP, Samples

HERE = Path(__file__).resolve().parent
REPO = HERE.parents[1]
LIMIT_S = 300.0  # of a command, on a machine that does other work too
GONE_S = 10.0  # within which the processes of a command that was killed must have ended
HOUR_S = 3600.0
# What a scan's results of before a change are called, which is kept on purpose.
KEPT_ASIDE = ".old"


@dataclass(frozen=True)
class Undisturbed:
    """What the command does when nobody disturbs it: how long it takes, its exit code, its answers, how often it writes."""

    seconds: float
    code: int
    answers: Answers
    writes: int


@dataclass
class Faulted:
    """A trial's state. `broken`: the rules that were not kept, in words; `struck`: whether the fault met a running command."""

    command: Tried
    folder: Path
    samples: Samples
    rng: np.random.Generator
    known: Undisturbed | None = None
    struck: bool = True
    broken: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True)
        self.samples.copied(self.folder / "in")
        if self.command.name == "map":
            (self.folder / "in" / MAP).unlink()
        for name in ("out", "tmp", "cache"):
            (self.folder / name).mkdir()
        self.inputs = {path.name for path in (self.folder / "in").iterdir()} | {MAP}

    @property
    def out(self) -> Path:
        """The folder that the command writes to."""
        return self.folder / ("in" if self.command.name == "map" else "out")

    def start(self, fault: dict[str, Any] | None = None, limit_mb: int = 0) -> subprocess.Popen[str]:
        """The command, with a `fault` of injected/sitecustomize.py, and with so much address space for each process."""
        asked = dict(fault or {}) | ({"stub": STUB_S} if self.command.stub else {})
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(HERE / "injected"), str(REPO)]),
            "GSSMC_FAULT": json.dumps(asked),
            "GSSMC_TRIAL": str(self.folder),
            "TMPDIR": str(self.folder / "tmp"),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "OPENBLAS_NUM_THREADS": "1",
        }

        def limit() -> None:
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # which a shell that starts us in the background takes away
            if limit_mb:
                resource.setrlimit(resource.RLIMIT_AS, (limit_mb << 20, limit_mb << 20))

        engine = [] if self.command.blender else ["-P", "-m", "core"]
        call = [sys.executable, *engine, *self.command.arguments(self.folder)]
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        return subprocess.Popen(call, cwd=self.folder, env=environment, text=True, preexec_fn=limit, **pipes)  # noqa: PLW1509

    def end(self, process: subprocess.Popen[str]) -> int:
        """Waits for the command's end, and that of all of its processes; its exit code."""
        try:
            said = process.communicate(timeout=LIMIT_S)[1]
        except subprocess.TimeoutExpired:
            self.broken.append("hung")
            process.kill()
            said = process.communicate()[1]
        self.said.append(said)
        if "Traceback" in said:
            self.broken.append(f"said a traceback: {said.strip().splitlines()[-1][:200]}")
        end = time.monotonic() + GONE_S
        while self.processes() and time.monotonic() < end:
            time.sleep(0.05)
        if left := self.processes():
            self.broken.append(f"{len(left)} processes left")
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        return process.returncode

    def processes(self) -> list[int]:
        """The running processes of this trial, its main one among them."""
        mark = f"GSSMC_TRIAL={self.folder}\0".encode()
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                ours = entry.name.isdigit() and mark in (entry / "environ").read_bytes() + b"\0"
                if ours and (entry / "stat").read_text().rpartition(")")[2].split()[0] != "Z":
                    found.append(int(entry.name))
        return found

    def workers(self, process: subprocess.Popen[str]) -> list[int]:
        return [pid for pid in self.processes() if pid != process.pid]

    def moment(self, process: subprocess.Popen[str], share: float | None = None) -> bool:
        """Waits for a moment of the command's usual time, drawn at random where none is given; whether it still runs then."""
        assert self.known is not None
        wait = self.known.seconds * (self.rng.uniform(0.02, 0.95) if share is None else share)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(wait)
        self.struck = process.poll() is None
        return self.struck

    def right(self, answers: Answers, when: str, known: Undisturbed | None = None) -> None:
        """All `answers` must be those of the undisturbed run."""
        expected = (known or self.known).answers  # type: ignore[union-attr]
        for name, answer in answers.items():
            if "error" not in answer and steady(answer, self.folder) != expected.get(name):
                self.broken.append(f"a wrong answer {when}: {name}")

    def is_right(self, answers: Answers, known: Undisturbed) -> bool:
        return all(steady(answer, self.folder) == known.answers.get(name) for name, answer in answers.items())

    def again(self, kept: Answers, known: Undisturbed | None = None) -> None:
        """The same command without a fault: it completes, with the right answers, and with those `kept` from before as they
        are; and it leaves nothing behind.
        """
        known = known or self.known
        assert known is not None
        # What was left is removed when nobody can be working on it any more: as if the next run came two hours later.
        for path in [*(self.folder / "tmp").iterdir(), *self.folder.rglob("*.part")]:
            os.utime(path, (time.time() - 2 * HOUR_S,) * 2)
        code = self.end(self.start())
        answers = self.command.answers(self.folder)
        if code != known.code or set(answers) != set(known.answers):
            self.broken.append(f"the next run did not complete: exit code {code}, {self.said[-1].strip()[-300:]}")
        self.right(answers, "in the next run", known)
        for name, answer in kept.items():
            if _seconds(answers.get(name)) != _seconds(answer):
                self.broken.append(f"a finished photo was lost: {name}")
        self._left_over()

    def _left_over(self) -> None:
        expected = {self.command.out, "lost+found"}
        left = [p.name for p in (self.folder / "out").iterdir() if p.name not in expected and not p.name.endswith(KEPT_ASIDE)]
        # Blender has a folder for itself, which it cannot remove when it is killed.
        left += [path.name for path in (self.folder / "tmp").iterdir() if not path.name.startswith("blender_")]
        left += [path.name for path in (self.folder / "in").iterdir() if path.name not in self.inputs]
        left += [str(path.relative_to(self.folder)) for path in (self.folder / "cache").rglob("*.part")]
        if left:
            self.broken.append(f"left over: {', '.join(left)}")

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


def _seconds(answer: Any) -> Any:
    """By which an answer that was found anew is told from the one of before."""
    return answer.get(UNSTEADY[0]) if isinstance(answer, dict) else answer


def undisturbed(
    command: Tried, folder: Path, samples: Samples, prepare: Callable[[Faulted], None] | None = None
) -> Undisturbed:
    """Runs the command twice in folders of their own: once timed, once with its writes counted. Raises where the two differ."""
    seen: list[tuple[float, int, Answers]] = []
    count = folder / "writes"
    for number in range(2):
        trial = Faulted(command, folder / str(number), samples, np.random.default_rng(0))
        if prepare is not None:
            prepare(trial)
        began = time.monotonic()
        code = trial.end(trial.start({"count": str(count)} if number else None))
        seconds = time.monotonic() - began
        assert not trial.broken, trial.broken
        trial._left_over()
        assert not trial.broken, trial.broken
        seen.append((seconds, code, steady(command.answers(trial.folder), trial.folder)))
        assert seen[-1][2], trial.said
        trial.remove()
    assert seen[0][1:] == seen[1][1:], f"two runs of {command.name} differ"
    return Undisturbed(min(seen[0][0], seen[1][0]), seen[0][1], seen[0][2], int(count.read_text()))
