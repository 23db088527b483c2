"""What a batch costs beside its photos: thousands of queries, with workers that answer at once with the same record.

    .venv/bin/python benchmarks/growth.py

The whole command `batch` runs, but its worker processes are stubs, which see no photo and hold no scan. Printed are the
parent's processor time and the wall-clock time per photo, the growth of its memory from the first tenth of the photos to the
last, the journal's bytes per photo in the first tenth and in the last, and how long the same command takes when all is finished
already (processor and wall-clock time).
"""

import argparse
import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPO))

import numpy as np

from core.batch.store import ResultStore
from core.cameras.files import camera_to_dict
from core.cli.main import main as command
from core.processes import pool
from core.processes.child import Child
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene, sample_cameras

PAGE = os.sysconf("SC_PAGE_SIZE")
STUB = f"""
import json, sys
sys.path.insert(0, {str(REPO)!r})
from core.processes.requests import Requests
requests = Requests()
requests.next()
requests.answer({{"dropped": 0}})
record = json.loads(sys.argv[1])
while True:
    job, _ = requests.next()
    camera = job["camera"]
    requests.answer({{**camera, **record, "start": {{"R": camera["R"], "t": camera["t"]}}}})
"""


def found() -> dict:
    """As much as a refinement of three iterations leaves behind, 3 KB, beside its camera."""
    pose = {"R": [[0.1234567890123456, -0.1234567890123456, 0.9876543210123456]] * 3, "t": [1.2345678901234567] * 3}
    iteration = {"views_used": 7, "matches": 1234, "inliers": 987, "epipolar_rms_px": 0.4567890123456789, **pose}
    reasons = ["7 of 7 views agree, 6543 inliers cover 87 % of the photo."]
    more = {"details": ["x" * 400], "quality": dict.fromkeys(map(str, range(20)), 0.123456789), "lens_evidence": None}
    return {"verdict": "trusted", "reasons": reasons, "iterations": [iteration] * 3, "seconds": 6.543, **more}


class Stub(Child):
    def __init__(self, *_: object) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        argv = [sys.executable, "-c", STUB, json.dumps(found())]
        self._process = subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said)


def memory_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE / 1e6


@dataclass
class Seen:
    """What is noted at each tenth of the photos: processor and wall-clock seconds, memory, bytes of the journal."""

    count: int
    done: int = 0
    marks: list[tuple[float, float, float, int]] = field(default_factory=list)

    def mark(self, journal: Path) -> None:
        size = journal.stat().st_size if journal.exists() else 0
        self.marks.append((time.process_time(), time.perf_counter(), memory_mb(), size))


def run(folder: Path, count: int, workers: int) -> tuple[Seen, tuple[float, float]]:
    """What was noted of a batch of `count` photos, and the seconds that the same command needs when all is done."""
    write_ply(folder / "scan.ply", make_scene(0, 2000))
    camera = camera_to_dict(sample_cameras(1)[0])
    frames = [{**camera, "file": f"IMG_{k:05d}.jpg"} for k in range(count)]
    for frame in frames:
        (folder / frame["file"]).write_bytes(b"x")
    (folder / "queries.json").write_text(json.dumps({"frames": frames}))
    out, seen, put = folder / "results.json", Seen(count), ResultStore.put
    journal = out.with_name("results.json.journal")

    def counted_put(store: ResultStore, index: int, record: dict) -> None:
        if seen.done == 0:
            seen.mark(journal)
        put(store, index, record)
        seen.done += 1
        if seen.done % (count // 10) == 0:
            seen.mark(journal)

    argv = ["batch", str(folder / "scan.ply"), str(folder / "queries.json"), "--out", str(out), "--workers", str(workers)]
    pool.Child, ResultStore.put = Stub, counted_put  # type: ignore[misc, assignment]
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        assert command([*argv, "--no-locate"]) == 0
        began = time.process_time(), time.perf_counter()
        assert command([*argv, "--no-locate"]) == 0
        again = time.process_time() - began[0], time.perf_counter() - began[1]
    ResultStore.put = put  # type: ignore[method-assign]
    assert len(json.loads(out.read_text())["frames"]) == count
    return seen, again


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    columns = ("CPU ms a photo", "wall ms a photo", "memory grows by, MB", "journal bytes a photo, first and last tenth")
    print("| photos |", " | ".join(columns), "| resume, CPU s | wall s |")
    print("|---|---|---|---|---|---|---|")
    for count in options.counts:
        with tempfile.TemporaryDirectory() as folder:
            seen, again = run(Path(folder), count, options.workers)
        marks = np.array(seen.marks)
        cpu, wall = 1e3 * (marks[-1, :2] - marks[0, :2]) / count
        first, last = np.diff(marks[:, 3])[[0, -1]] / (count // 10)
        grown = marks[-1, 2] - marks[1, 2]
        row = f"{cpu:.2f} | {wall:.2f} | {grown:.1f} | {first:.0f}, {last:.0f} | {again[0]:.2f} | {again[1]:.2f}"
        print(f"| {count} | {row} |", flush=True)
    print(f"Most memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB")


if __name__ == "__main__":
    main()
