"""What a large scan costs: opening it, refining a photo in it, and sharing it among the workers of a batch.

    .venv/bin/python benchmarks/scale.py [--scans 1 8x1 8x4 8x8] [--photos 1] [--folder DIR] [--parts open refine workers]

The scans: the fox with each Gaussian split into so many smaller ones (8 along its longest axis, or 8 along it times 4 or 8
along the second), in its place and colour; "8x8" has SH of degree 3, 2.4 GB. "room:N", "yard:N": the procedural room or
courtyard of N Gaussians (their opening and workers only). "world:N": N copies of the fox in one world, of which a camera sees
one. Each scan is made in a process of its own, in DIR, and removed afterwards; each figure is taken in a fresh process.

Seconds are those of the processor (user and system), of one thread; "wall" beside them is the clock's. Memory is PSS: what
processes share counts once. Needs ../shared/scenes (see the README).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(ROOT / "benchmarks"))

from large_scans import copies, scene_of
from real_scenes import SCENES, STARTS, start_camera

from core.cameras.files import camera_to_dict, read_cameras
from core.geometry.camera import Camera, pose_error
from core.photos.photo import read_photo
from core.pose.refine import refine
from core.pose.settings import RefineSettings
from core.processes.channel import Channel
from core.processes.child import ONE_THREAD, Child
from core.render import Renderer
from core.render.scan.opening import OFF, SWITCH, open_scan
from core.splats import read_splats
from core.splats.digest import scan_file_digest
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene
from core.synthetic.buildings import courtyard
from core.synthetic.split import split_scene

FOX = SCENES / "fox"
FULL_SH = "8x8"  # the scan whose colours are brought to degree 3, as most users' scans have
VIEW_PX = 640
FEW = {"iterations": 1, "candidates": 2}
POLL_S = 0.2
LIMIT_S = 3600.0


def fox_cameras() -> tuple[list[Camera], float]:
    return read_cameras(FOX / "queries.json"), json.loads((FOX / "queries.json").read_text())["median_depth"]


def make(name: str, path: str) -> None:
    """Writes the scan of that name."""
    kind, _, count = name.partition(":")
    if kind in ("room", "yard"):
        write_ply(path, (make_scene if kind == "room" else courtyard)(gaussians=int(count)))
        return
    scene = read_splats(FOX / "scene.ply")
    if kind == "world":
        scene = copies(scene, int(count))
    elif name != "1":
        cameras, depth = fox_cameras()
        k = cameras[0].intrinsics
        across, along = map(int, name.split("x"))
        scene = split_scene(scene, (across, along), depth / (k.focal * VIEW_PX / max(k.width, k.height)))
    if name == FULL_SH:
        sh = np.zeros((len(scene), 16, 3), np.float32)
        sh[:, : scene.sh.shape[1]] = scene.sh
        scene = scene_of(scene.means, scene.scales, scene.rotations, scene.opacities, sh)
    write_ply(path, scene)


def pss(pids: list[int]) -> float:
    """Memory of processes together, GB; what they share counts once."""
    total = 0
    for pid in pids:
        try:
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        except OSError:  # it has ended
            continue
        total += sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return total / 1e6


class Peak:
    """The most memory of some processes while a block runs."""

    def __init__(self, pids: list[int]) -> None:
        self.pids, self.gb, self._end = pids, 0.0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Peak:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._end.wait(POLL_S):
            self.gb = max(self.gb, pss(self.pids))


def processor() -> float:
    times = os.times()
    return times.user + times.system


def opened(path: str) -> dict[str, Any]:
    """Opening in a process that does nothing else."""
    with Peak([os.getpid()]) as peak:
        began, spent = time.perf_counter(), processor()
        scan = open_scan(Path(path))
        return {
            "wall": time.perf_counter() - began,
            "spent": processor() - spent,
            "count": len(scan.tables),
            "gb": max(peak.gb, pss([os.getpid()])),
        }


def refined(path: str, photos: int) -> dict[str, Any]:
    """Near refinements, after opening."""
    scan, (cameras, depth) = open_scan(Path(path)), fox_cameras()
    renderer, results = Renderer(scan.tables, scan.settings(threads=1)), []
    with Peak([os.getpid()]) as peak:
        for index, truth in enumerate(cameras[:photos]):
            photo, camera = read_photo(FOX / truth.file), start_camera(truth, depth, *STARTS["near"], seed=index)
            began, spent = time.perf_counter(), processor()
            report = refine(renderer, photo, camera, RefineSettings(threads=1))
            distance, degrees = pose_error(report.camera.pose, truth.pose)
            results.append((processor() - spent, time.perf_counter() - began, 100 * distance / depth, degrees, report.verdict))
    return {"results": results, "gb": peak.gb}


def workers(path: str, count: int) -> dict[str, Any]:
    """The memory of a batch's workers that refine a photo each, in few views, which take as much memory as many do."""
    cameras, depth = fox_cameras()
    children = [Child("batch.worker", ONE_THREAD) for _ in range(count)]
    channels, settings = [Channel(child) for child in children], {**asdict(RefineSettings(threads=1)), **FEW}

    first = {"scene": path, "digest": scan_file_digest(Path(path), dated=False), "settings": settings}

    def work(index: int) -> None:
        truth = cameras[index]
        channels[index].ask(first, limit_s=LIMIT_S)
        start = camera_to_dict(start_camera(truth, depth, *STARTS["near"], seed=index))
        job = {"camera": start, "photo": str(FOX / truth.file), "mask": None}
        channels[index].ask(job, limit_s=LIMIT_S)

    threads = [threading.Thread(target=work, args=(index,)) for index in range(count)]
    pids = [int(pid) for tasks in Path("/proc/self/task").glob("*/children") for pid in tasks.read_text().split()]
    with Peak(pids) as peak:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for channel in channels:
        channel.close()
    return {"gb": peak.gb}


def alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """The answer of a function in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(function, arguments)


def measured(name: str, options: argparse.Namespace, base: dict[str, float]) -> Iterator[str]:
    """The lines of one scan. `base`: seconds of a refinement in the first scan, once it is known."""
    path = str(options.folder / f"scan_{name.replace(':', '_')}.ply")
    if not Path(path).exists():
        alone(make, name, path)
    try:
        first, again = alone(opened, path), alone(opened, path)
        yield (
            f"open {name}: {first['count']} Gaussians, {Path(path).stat().st_size / 1e9:.2f} GB; first {first['spent']:.1f} s "
            f"(wall {first['wall']:.1f}), {first['gb']:.2f} GB; again {again['spent']:.2f} s (wall {again['wall']:.2f})"
        )
        fox = ":" not in name or name.startswith("world")
        if "refine" in options.parts and fox:
            answer = alone(refined, path, options.photos)
            spent, wall, pct, degrees = np.mean([r[:4] for r in answer["results"]], axis=0)
            base.setdefault("spent", spent)
            verdicts = ", ".join(r[4] for r in answer["results"])
            yield (
                f"refine {name}: {spent:.1f} s (wall {wall:.1f}), {spent / base['spent']:.2f} times the first; "
                f"{pct:.3f} % / {degrees:.3f} deg, {verdicts}; peak {answer['gb']:.2f} GB"
            )
        if "workers" in options.parts and fox:
            one, two = (alone(workers, path, count)["gb"] for count in (1, 2))
            yield f"workers {name}: one {one:.2f} GB, two {two:.2f} GB, {two / one:.2f} times"
    finally:
        if not options.keep:
            Path(path).unlink()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", nargs="+", default=["1", "8x1", "8x4", "8x8"])
    parser.add_argument("--parts", nargs="+", choices=("refine", "workers"), default=["refine", "workers"])
    parser.add_argument("--photos", type=int, default=1)
    parser.add_argument("--folder", type=Path, help="for the scans and their cache, 5 GB (a new one among the temporary files)")
    parser.add_argument("--no-cache", action="store_true", help="as with GSSMC_SCAN_CACHE=off: nothing is kept or shared")
    parser.add_argument("--keep", action="store_true", help="leave the scans in the folder")
    options = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    base: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        options.folder = options.folder or Path(folder)
        os.environ[SWITCH] = OFF if options.no_cache else str(options.folder / "cache")
        for name in options.scans:
            for line in measured(name, options, base):
                print(f"{line} [load {os.getloadavg()[0]:.1f}]", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
