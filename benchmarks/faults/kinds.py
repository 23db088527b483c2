"""What may happen to a command. Each fault starts it and hurts it; `Faulted.again` judges what the next run makes of that."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from damage import damage_file
from samples import MAP, SCAN
from trial import Faulted, Undisturbed

from core.locate.cache import SUFFIX

KILLED = -signal.SIGKILL
JUMPS_S = (-1e9, -86_400.0, -3600.0, 3600.0, 86_400.0, 1e9)


def _judge(trial: Faulted, code: int, fine: tuple[int, ...] = ()) -> None:
    """After the fault: what is finished is right, and the next run keeps it. `fine`: exit codes beside that of a whole run."""
    _check_code(trial, code, fine)
    kept = trial.command.kept(trial.folder)
    trial.right(kept, "on disk")
    trial.again(kept)


def _check_code(trial: Faulted, code: int, fine: tuple[int, ...]) -> None:
    assert trial.known is not None
    if code not in (trial.known.code, *fine):
        trial.broken.append(f"exit code {code}: {trial.said[-1].strip()[-200:]}")


def worker_killed(trial: Faulted) -> None:
    """kill -9 of one of its processes, at random moments, twice."""
    process, struck = trial.start(), 0
    for _ in range(2):
        trial.moment(process, trial.rng.uniform(0.1, 0.5))
        workers = trial.workers(process)
        struck += bool(workers)
        if workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(int(trial.rng.choice(workers)), signal.SIGKILL)
    trial.struck = struck > 0
    _judge(trial, trial.end(process), fine=(2, 3))


def command_killed(trial: Faulted) -> None:
    """kill -9 of the command itself, at a random moment."""
    process = trial.start()
    trial.moment(process)
    process.kill()
    _judge(trial, trial.end(process), fine=(KILLED,))


def interrupted(trial: Faulted) -> None:
    """Ctrl-C at a random moment, at which the command still writes what it has."""
    process = trial.start()
    if trial.moment(process):
        process.send_signal(signal.SIGINT)
    _judge(trial, trial.end(process), fine=(130, -signal.SIGINT))


def killed_while_writing(trial: Faulted) -> None:
    """kill -9 of the command right before it opens a file to write, brings it to the disk, names it anew or removes it."""
    assert trial.known is not None
    process = trial.start({"die": int(trial.rng.integers(1, trial.known.writes + 1))})
    code = trial.end(process)
    trial.struck = code == KILLED
    _judge(trial, code, fine=(KILLED,))


def disk_full(trial: Faulted) -> None:
    """A file system of its own for the output, nearly full from the start."""
    free = int(trial.rng.choice([0, 1, 2, 4, 40, 200])) << 12
    with _own_disk(trial.out, 4 << 20):
        ballast = trial.out / "ballast"
        state = os.statvfs(trial.out)
        ballast.write_bytes(bytes(max(state.f_bavail * state.f_frsize - free, 0)))
        code = trial.end(trial.start())
        ballast.unlink()
        trial.struck = code == 2
        _judge(trial, code, fine=(2,))


def output_read_only(trial: Faulted) -> None:
    """A file system that cannot be written to."""
    with _own_disk(trial.out, 4 << 20) as option:
        option("ro")
        code = trial.end(trial.start())
        option("rw")
        _judge(trial, code, fine=(2,))


@contextlib.contextmanager
def _own_disk(folder: Path, size: int):
    """A file system of `size` bytes in place of the folder, with what was in it; yields what sets an option of it."""
    before = folder.with_name(f"{folder.name}.before")
    shutil.copytree(folder, before)
    _mount("-t", "tmpfs", "-o", f"size={size}", "none", str(folder))
    try:
        shutil.copytree(before, folder, dirs_exist_ok=True)
        yield lambda option: _mount("-o", f"remount,{option}", str(folder))
    finally:
        subprocess.run(["umount", str(folder)], check=True)
        shutil.rmtree(before)


def _mount(*arguments: str) -> None:
    subprocess.run(["mount", *arguments], check=True, capture_output=True)


def folder_vanishes(trial: Faulted) -> None:
    """The output's folder is gone from a random moment on, as a network's is, and comes back soon or after the end. Whatever
    was made in its place meanwhile is hidden by it then.
    """
    away = trial.folder / "away"
    process = trial.start()
    trial.moment(process)
    trial.out.rename(away)
    if trial.rng.random() < 0.3:
        time.sleep(trial.rng.uniform(0.1, 1.0))
        _back(away, trial.out)
    code = trial.end(process)
    if away.exists():
        _back(away, trial.out)
    _judge(trial, code, fine=(2,))


def _back(away: Path, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    away.rename(folder)


def clock_jumps(trial: Faulted) -> None:
    """The clock is set at a random moment, by an hour or by decades, and the files bear times of after or before it."""
    assert trial.known is not None
    seconds = float(trial.rng.choice(JUMPS_S))
    process = trial.start({"jump": [time.monotonic() + trial.rng.uniform(0, trial.known.seconds), seconds]})
    if trial.rng.random() < 0.5:
        trial.moment(process)
        process.kill()
    code = trial.end(process)
    for path in trial.out.iterdir():
        if path.is_file() and path.name not in trial.inputs - {MAP}:
            os.utime(path, (max(time.time() + seconds, 1.0),) * 2)
    _judge(trial, code, fine=(KILLED,))


def two_at_once(trial: Faulted) -> None:
    """The same command twice on the same output."""
    first = trial.start()
    trial.moment(first, trial.rng.uniform(0.0, 0.6))
    second = trial.start()
    codes = [trial.end(first), trial.end(second)]
    assert trial.known is not None
    if trial.known.code not in codes:
        trial.broken.append(f"neither run completed: {codes}")
    _judge(trial, trial.known.code)
    if any(code not in (trial.known.code, 2) for code in codes):
        trial.broken.append(f"exit codes {codes}")


def memory_out(trial: Faulted) -> None:
    """So little address space for each process that one of them finds none at some place."""
    code = trial.end(trial.start(limit_mb=int(trial.rng.integers(*trial.command.memory_mb))))
    trial.struck = code != trial.known.code if trial.known else True
    # Python itself may not come up with so little, and says it in its own way.
    trial.broken[:] = [one for one in trial.broken if "traceback" not in one or "ImportError" not in one]
    _judge(trial, code, fine=(1, 2, 3, -signal.SIGSEGV, -signal.SIGABRT, 127))


def bytes_damaged(trial: Faulted) -> None:
    """A run is interrupted or ends, then its journal, its results or the scan's map have flipped, missing or zeroed bytes."""
    process = trial.start()
    if not trial.command.blender and trial.moment(process, trial.rng.uniform(0.5, 1.2)):
        process.send_signal(signal.SIGINT if trial.rng.random() < 0.5 else signal.SIGKILL)
    trial.end(process)
    files = [path for path in (trial.folder / "out").iterdir() if path.suffix != ".part" and path.stat().st_size]
    map_file = trial.folder / "in" / MAP
    if map_file.exists() and (trial.command.name in ("locate", "map", "batch, finding") or not files):
        files.append(map_file)
    if trial.command.blender:
        files = list((trial.folder / "cache").rglob(f"*{SUFFIX}"))
    trial.struck = bool(files)
    if files:
        damage_file(files[trial.rng.integers(len(files))], trial.rng)
    trial.again({})


def decoder_killed(trial: Faulted) -> None:
    """A picture at which the process that reads it aborts; mended before the next run."""
    track, locate = trial.command.name == "track", trial.command.name == "locate"
    name = "plate.1003.png" if track else "plate.1002.png" if locate else f"photo_{trial.rng.integers(3)}.png"
    code = trial.end(trial.start({"killer": name, "killer_any": track or locate}))
    kept = trial.command.kept(trial.folder)
    if not (track or locate) and trial.known and len(kept) != len(trial.known.answers) - 1:
        trial.broken.append(f"{len(kept)} photos were finished beside the one that kills")
    _judge(trial, code, fine=(3, -signal.SIGABRT))


def replaced(trial: Faulted, other: Undisturbed | None = None) -> None:
    """The scan is another one from a random moment on: renamed into its place, or written over it slowly. Then the first one is
    put back with its time, and what the run in between left may not stand for it; then the other one is there for good.
    """
    scan, before = trial.folder / "in" / SCAN, trial.folder / "before"
    shutil.copy2(scan, before)
    process = trial.start()
    trial.moment(process, trial.rng.uniform(0.02, 0.8))
    if trial.rng.random() < 0.5:
        shutil.copyfile(trial.samples.other, trial.folder / "new")
        os.replace(trial.folder / "new", scan)
    else:
        data = trial.samples.other.read_bytes()
        with scan.open("wb") as file:
            for start in range(0, len(data), len(data) // 4 + 1):
                file.write(data[start : start + len(data) // 4 + 1])
                file.flush()
                time.sleep(0.1)
    stamp = scan.stat()
    code = trial.end(process)
    shutil.copyfile(scan, trial.folder / "new")
    shutil.copy2(before, scan)
    _check_code(trial, code, (2, 3))
    kept = trial.command.kept(trial.folder)
    if other is not None and kept and trial.is_right(kept, other):
        # It was replaced before the command had looked at it: all is of the other scan, and none of it may be taken over.
        trial.struck, kept = False, {}
    trial.right(kept, "on disk")
    trial.again(kept)
    if other is not None:
        shutil.copyfile(trial.folder / "new", scan)
        os.utime(scan, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
        trial.again({}, other)


def picture_replaced(trial: Faulted) -> None:
    """A photo or frame is another one from a random moment on; then the first one is put back with its time."""
    folder = trial.folder / "in"
    pair = ("plate.1003.png", "plate.1004.png") if trial.command.name == "track" else ("photo_2.png", "photo_3.png")
    picture = folder / pair[0]
    shutil.copy2(picture, trial.folder / "before")
    process = trial.start()
    trial.moment(process, trial.rng.uniform(0.02, 0.8))
    shutil.copyfile(folder / pair[1], picture)
    code = trial.end(process)
    shutil.copy2(trial.folder / "before", picture)
    _check_code(trial, code, (2, 3))
    kept = trial.command.kept(trial.folder)
    if trial.known is not None and not trial.is_right(
        {name: one for name, one in kept.items() if name == pair[0]}, trial.known
    ):
        # It was replaced before the command had looked at it. Where that is not so, the next run takes a wrong answer over.
        trial.struck = False
        del kept[pair[0]]
    trial.right(kept, "on disk")
    trial.again(kept)


def slow_disk(trial: Faulted) -> None:
    """Every fsync takes half a second, and the command is killed at a random moment or not."""
    process = trial.start({"slow": 0.5})
    if trial.rng.random() < 0.5 and trial.moment(process):
        process.kill()
    _judge(trial, trial.end(process), fine=(KILLED,))


KINDS: dict[str, Callable[[Faulted], None]] = {
    "a worker killed": worker_killed,
    "the command killed": command_killed,
    "Ctrl-C": interrupted,
    "killed while writing": killed_while_writing,
    "disk full": disk_full,
    "output read-only": output_read_only,
    "output folder vanishes": folder_vanishes,
    "slow disk": slow_disk,
    "clock jumps": clock_jumps,
    "two runs on one output": two_at_once,
    "out of memory": memory_out,
    "bytes damaged": bytes_damaged,
    "a picture that kills the decoder": decoder_killed,
    "scan replaced": replaced,
    "picture replaced": picture_replaced,
}
