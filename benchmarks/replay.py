"""What is left of a refinement where drawing costs nothing: its views are recorded once, and replayed from memory.

    .venv/bin/python benchmarks/replay.py [--scenes fox] [--starts near] [--photos N] [--threads N] [--again N]
                                          [--steps | --path]

That is the bound for a renderer that is infinitely fast, and what a graphics card can come near to. --again: each replay is
timed so many times, of which the fastest counts; --steps: where the time of the replays goes, by what the refinement says that
it does; --path: views are worked on one after the other, and beside the processor seconds stands what would be left of them if
every view of a fan had a core of its own. Needs the scans in ../shared/scenes (see the README).
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.real_scenes import SCENES, STARTS, Scan, start_camera
from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.photo import Photo, read_photo
from core.pose.final import stage
from core.pose.refine import iterate_refinement
from core.pose.report import RefineReport
from core.pose.search import loop
from core.pose.settings import RefineSettings
from core.render import ProcessRenderer, RenderSettings
from core.render.view import RenderedView, ViewRenderer, sole_renderer

Key = tuple[object, ...]
VIEW_POOL = stage.view_pool


class ReplayRenderer:
    """A renderer that keeps every view that it draws, and gives it again at no cost.

    `drawn`: views that were drawn, `given`: those that were replayed since `rewind`.
    """

    def __init__(self, renderer: ViewRenderer) -> None:
        self._renderer, self._views = renderer, dict[Key, RenderedView]()
        self._lock = threading.Lock()
        self.drawn = self.given = 0

    def rewind(self) -> None:
        """Counts from nothing again."""
        self.drawn = self.given = 0

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        return self._drawn(self._renderer, intrinsics, pose)

    @property
    def sole(self) -> ViewRenderer:
        return _Sole(self)

    def draw_sole(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        """As `render`, for a view that no other is drawn beside."""
        return self._drawn(sole_renderer(self._renderer), intrinsics, pose)

    def _drawn(self, renderer: ViewRenderer, k: Intrinsics, pose: Pose) -> RenderedView:
        key = (k.width, k.height, k.fx, k.fy, k.cx, k.cy, pose.R.tobytes(), pose.t.tobytes())
        found = self._views.get(key)
        if found is None:
            found = renderer.render(k, pose)
        with self._lock:
            replayed = key in self._views
            self.given, self.drawn = self.given + replayed, self.drawn + (not replayed)
            self._views[key] = found
        return found


class _Sole:
    def __init__(self, renderer: ReplayRenderer) -> None:
        self._renderer = renderer

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        return self._renderer.draw_sole(intrinsics, pose)


@dataclass(frozen=True)
class Run:
    """One refinement: its report, wall and processor seconds of this process, and wall seconds by step."""

    report: RefineReport
    wall_s: float
    processor_s: float
    steps: Counter[str]


def timed(renderer: ReplayRenderer, photo: Photo, camera: Camera, settings: RefineSettings) -> Run:
    """A refinement; a step lasts from where the refinement names it to where it names the next."""
    steps: Counter[str] = Counter()
    wall, processor = time.perf_counter(), time.process_time()
    step, since = "before the first step", wall
    refinement = iterate_refinement(renderer, photo, camera, settings)
    while True:
        try:
            news = next(refinement)
        except StopIteration as end:
            now = time.perf_counter()
            steps[step] += now - since
            return Run(end.value, now - wall, time.process_time() - processor, steps)
        now = time.perf_counter()
        steps[step] += now - since
        step, since = "".join(c for c in news.step if not c.isdigit()).split(" of ")[0].strip(), now


class OneByOne:
    """In place of the pool that works on a fan's views side by side; `spared_s`: what cores enough would spare."""

    def __init__(self) -> None:
        self.spared_s, self._fan = 0.0, list[float]()

    @contextlib.contextmanager
    def pool(self, threads: int) -> Iterator[OneByOne]:
        self._fan = []
        yield self
        self.spared_s += sum(self._fan) - max(self._fan, default=0.0)

    def submit(self, function: Callable[..., object], *given: object) -> Future[object]:
        future: Future[object] = Future()
        since = time.process_time()
        future.set_result(function(*given))
        self._fan.append(time.process_time() - since)
        return future


def path_row(scan: Scan, renderer: ViewRenderer, index: int, args: argparse.Namespace) -> str:
    """Processor seconds of one photo's replay, and those of its longest path."""
    truth, one_by_one = scan.cameras[index], OneByOne()
    camera = start_camera(truth, scan.depth, *STARTS[args.starts], seed=index)
    work = (ReplayRenderer(renderer), read_photo(SCENES / scan.name / truth.file), camera, RefineSettings(threads=args.threads))
    timed(*work)
    loop.view_pool = stage.view_pool = one_by_one.pool  # type: ignore[assignment, attr-defined]
    cv2.setNumThreads(1)
    try:
        runs = []
        for _ in range(args.again):
            one_by_one.spared_s = 0.0
            seconds = timed(*work).processor_s
            runs.append((seconds, seconds - one_by_one.spared_s))
    finally:
        loop.view_pool = stage.view_pool = VIEW_POOL  # type: ignore[attr-defined]
    seconds, path = min(runs)
    return f"| {scan.name} | {Path(truth.file).stem} | {seconds:.2f} | {path:.2f} |"


def run_photo(scan: Scan, renderer: ViewRenderer, index: int, args: argparse.Namespace) -> tuple[str, Run, Run]:
    """The row of one photo, and its refinement with views drawn and replayed."""
    truth, start = scan.cameras[index], args.starts
    photo = read_photo(SCENES / scan.name / truth.file)
    camera = start_camera(truth, scan.depth, *STARTS[start], seed=index)
    settings = RefineSettings(threads=args.threads)
    replay = ReplayRenderer(renderer)
    first = timed(replay, photo, camera, settings)
    views = replay.drawn
    runs = []
    for _ in range(args.again):
        replay.rewind()
        runs.append(timed(replay, photo, camera, settings))
        if replay.drawn:
            print(f"{replay.drawn} views of {truth.file} were not the same again, and drawn", file=sys.stderr)
    best = min(runs, key=lambda run: run.wall_s)
    same = np.array_equal(first.report.camera.pose.R, best.report.camera.pose.R)
    cells = (scan.name, Path(truth.file).stem, views, f"{first.wall_s:.2f}", f"{best.wall_s:.2f}", f"{best.processor_s:.2f}")
    return f"| {' | '.join(map(str, cells))} | {best.report.verdict} | {'yes' if same else 'no'} |", first, best


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["fox"])
    parser.add_argument("--starts", choices=tuple(STARTS), default="near")
    parser.add_argument("--photos", type=int, default=0, help="the first so many of each scene (all)")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--again", type=int, default=2)
    parser.add_argument("--steps", action="store_true")
    parser.add_argument("--path", action="store_true")
    args = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, threads {args.threads or 'one per core'}")
    if args.path:
        print("| scan | photo | processor s | of that on the longest path |\n|---|---|---|---|")
        for name in args.scenes:
            scan = Scan.load(name)
            with ProcessRenderer(scan.scene, RenderSettings(threads=args.threads)) as renderer:
                for index in range(len(scan.cameras))[: args.photos or None]:
                    print(path_row(scan, renderer, index, args), flush=True)
        return
    print("| scan | photo | views | s drawn | s replayed | processor s replayed | verdict | same pose |")
    print("|---|---|---|---|---|---|---|---|")
    replayed, steps = [], Counter[str]()
    for name in args.scenes:
        scan = Scan.load(name)
        with ProcessRenderer(scan.scene, RenderSettings(threads=args.threads)) as renderer:
            for index in range(len(scan.cameras))[: args.photos or None]:
                text, _, best = run_photo(scan, renderer, index, args)
                print(text, flush=True)
                replayed.append(best)
                steps.update(best.steps)
    wall, processor = ([getattr(run, kind) for run in replayed] for kind in ("wall_s", "processor_s"))
    print(f"median {np.median(wall):.2f} s, largest {max(wall):.2f} s; processor: median {np.median(processor):.2f} s")
    if args.steps:
        print("| step | s a photo |\n|---|---|")
        for step, seconds in steps.most_common():
            print(f"| {step} | {seconds / len(replayed):.3f} |")


if __name__ == "__main__":
    main()
