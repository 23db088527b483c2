"""Where a farm stops scaling: a simulation over times that are measured here on one machine. No farm takes part in it.

    .venv/bin/python benchmarks/farm_model.py

First the cost of a photo and of opening the scan is measured, as processor time of whole batches of two and of eight photos,
with one and two processes and on a local Dask cluster. Then what a photo costs beside that: a line of the journal, and a task
of Dask (scheduler, client and worker threads in one process, so more than the two alone need).

The simulation takes these, a given length of a photo and a size of the scan. Its machines all read the scan at the start from
one storage. Its workers do photos of lengths spread as measured ones are. One server hands out tasks and takes results, as
scheduler and client do.
"""

import argparse
import heapq
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPO))

import cv2
import numpy as np

from core.batch.keys import key_of
from core.batch.store import ResultStore
from core.cameras.files import camera_to_dict
from core.render import Renderer, RenderSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_photo, make_scene, perturb_camera, sample_cameras

AHEAD = 2  # tasks per worker that are handed out at a time, as core/batch/farm/dask_pool.py does
SPREAD = 0.35  # deviation of a photo's time over its mean


@dataclass(frozen=True)
class Costs:
    """Seconds: of a photo, of starting a worker and opening the scan, of a line in the journal, of a task of Dask."""

    photo: float
    opening: float
    line: float
    task: float


def write_place(folder: Path, photos: int) -> None:
    scene = make_scene(0, 60_000)
    write_ply(folder / "scan.ply", scene)
    renderer, frames = Renderer(scene, RenderSettings(threads=1)), []
    for k, camera in enumerate(sample_cameras(photos)):
        cv2.imwrite(str(folder / f"{k}.png"), make_photo(renderer, camera, k).pixels[..., ::-1])
        frames.append({**camera_to_dict(perturb_camera(camera, 0.1, 2.0, k)), "file": f"{k}.png"})
    for count in (2, photos):
        (folder / f"queries_{count}.json").write_text(json.dumps({"frames": frames[:count]}))


def batch_seconds(folder: Path, photos: int, more: list[str]) -> tuple[float, float]:
    """Processor seconds of a batch with all its processes, and seconds on the clock."""
    out = folder / "results.json"
    out.unlink(missing_ok=True)
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    argv = [sys.executable, "-m", "core", "batch", str(folder / "scan.ply"), str(folder / f"queries_{photos}.json")]
    size = ["--long-side-px", "320", "--no-locate", "--exit-zero"]
    subprocess.run([*argv, "--out", str(out), *size, *more], cwd=REPO, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.perf_counter() - began


def journal_seconds(count: int = 2000) -> float:
    record = {"verdict": "trusted", "reasons": ["x" * 80], "iterations": [{"R": [[0.123456789] * 3] * 3}] * 12, "R": None}
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        with ResultStore(Path(folder) / "r.json", [key_of(k) for k in range(count)]) as store:
            for k in range(count):
                store.put(k, record)
        return (time.process_time() - began) / count


def task_seconds(count: int = 1000) -> float:
    """Processor time per task of a pool whose workers answer at once; the stubs' own is not in it. 0 without Dask."""
    try:
        from distributed import LocalCluster

        from core.batch.farm import dask_pool, dask_worker
    except ModuleNotFoundError:
        return 0.0
    from growth import Stub

    dask_worker.Child = Stub  # type: ignore[misc, assignment]
    job = {"camera": {"R": np.eye(3).tolist(), "t": [0.0, 0.0, 0.0]}, "photo": "/photos/IMG_0001.jpg", "mask": None}
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp", "dashboard_address": None}
    with LocalCluster(**options) as made, dask_pool.DaskPool({}, 2, made.scheduler_address) as pool:
        began = 0.0
        for _ in pool.run([(k, job) for k in range(count)], lambda k, words: {}, lambda n: None):
            began = began or time.process_time()
        return (time.process_time() - began) / count


def measure(photos: int) -> Costs:
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print("| processes | CPU s a photo | CPU s beside the photos | clock s, 2 photos | clock s, all |")
    print("|---|---|---|---|---|")
    ways = {"1": ["--workers", "1"], "2": ["--workers", "2"], "2, Dask": ["--workers", "2", "--executor", "dask"]}
    costs: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        write_place(Path(folder), photos)
        for name, more in ways.items():
            try:
                few, many = (batch_seconds(Path(folder), count, more) for count in (2, photos))
            except subprocess.CalledProcessError as error:
                print(f"| {name} | {error.stderr.decode().strip().splitlines()[-1]} |")
                continue
            each = (many[0] - few[0]) / (photos - 2)
            costs.append((each, few[0] - 2 * each))
            print(f"| {name} | {each:.2f} | {costs[-1][1]:.2f} | {few[1]:.1f} | {many[1]:.1f} |", flush=True)
    opening = max(costs[1][1] - costs[0][1], 0.0)  # what one process more costs
    line, task = journal_seconds(), task_seconds()
    print(f"A process more: {opening:.2f} s. A line of the journal: {1e3 * line:.2f} ms. A task of Dask: {1e3 * task:.2f} ms.")
    return Costs(costs[0][0], opening, line, task)


def photo_times(count: int, mean: float) -> np.ndarray:
    sigma = np.sqrt(np.log1p(SPREAD**2))
    return np.random.default_rng(0).lognormal(np.log(mean) - sigma**2 / 2, sigma, count)


def by_shards(times: np.ndarray, workers: int, ready: float, costs: Costs) -> float:
    """Seconds until all shards are done and joined."""
    return ready + max(times[k::workers].sum() for k in range(workers)) + len(times) * costs.line


def by_dask(times: np.ndarray, workers: int, ready: float, server: float) -> tuple[float, float]:
    """Seconds until all is done, and the share of them in which the server, which takes `server` seconds a photo, is busy."""
    handed, free, last = 0, 0.0, 0.0  # photos handed out; when the server is free
    waiting = [0] * workers  # photos that lie at each worker behind the one that it does
    events: list[tuple[float, int, int]] = []  # (time, 0: the worker is there or has done one, 1: one comes to it, worker)
    idle = set(range(workers))
    for _ in range(AHEAD):
        for worker in range(workers):
            if handed < len(times):
                free, handed = max(free, 0.0) + server / 2, handed + 1
                heapq.heappush(events, (max(free, ready), 1, worker))
    begun = done = 0
    while done < len(times):
        now, kind, worker = heapq.heappop(events)
        if kind == 0:
            done, last = done + 1, now
            free = max(free, now) + server / 2
            if handed < len(times):
                free, handed = free + server / 2, handed + 1
                heapq.heappush(events, (free, 1, worker))
            idle.add(worker)
        else:
            waiting[worker] += 1
        if worker in idle and waiting[worker]:
            waiting[worker] -= 1
            idle.discard(worker)
            heapq.heappush(events, (now + times[begun], 0, worker))
            begun += 1
    return max(last, free), len(times) * server / max(last, free)


def simulate(costs: Costs, options: argparse.Namespace) -> None:
    times = photo_times(options.photos, options.photo_s)
    whole = float(times.sum())
    print(
        f"\nSimulated: {options.photos} photos of {options.photo_s:g} s, a scan of {options.scan_gb:g} GB from one storage of "
        f"{options.storage_gb_s:g} GB/s, {options.opening_s or costs.opening:.1f} s to open it, {options.per_machine} workers "
        "a machine, of which the first reads the file."
    )
    print("| workers | reading the scan, s | shards: minutes, efficiency | Dask: minutes, efficiency | its server is busy |")
    print("|---|---|---|---|---|")
    server = costs.task + costs.line
    for workers in options.workers:
        reading = options.scan_gb * -(-workers // options.per_machine) / options.storage_gb_s
        ready = (options.opening_s or costs.opening) + reading
        shards, (dask, busy) = by_shards(times, workers, ready, costs), by_dask(times, workers, ready, server)
        cells = (f"{t / 60:.1f}, {whole / workers / t:.0%}" for t in (shards, dask))
        print(f"| {workers} | {reading:.0f} | {' | '.join(cells)} | {busy:.0%} |")
    if server:
        print(f"The server is the limit from {options.photo_s / server:.0f} workers on.")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--measured-photos", type=int, default=8)
    parser.add_argument("--photos", type=int, default=10_000)
    parser.add_argument("--photo-s", type=float, default=6.0, help="of a photo at the default settings on one core")
    parser.add_argument("--opening-s", type=float, default=0.0, help="start and opening, without the storage (as measured)")
    parser.add_argument("--scan-gb", type=float, default=1.5, help="10 million Gaussians with SH3 take 2.4")
    parser.add_argument("--storage-gb-s", type=float, default=1.0)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 10, 30, 100, 300, 1000])
    parser.add_argument("--per-machine", type=int, default=8, help="workers; the scan comes once to each machine")
    words = "seconds measured before, which are taken instead"
    parser.add_argument("--costs", type=float, nargs=4, metavar=("PHOTO", "OPENING", "LINE", "TASK"), help=words)
    options = parser.parse_args()
    simulate(Costs(*options.costs) if options.costs else measure(options.measured_photos), options)


if __name__ == "__main__":
    main()
