"""Accuracy and speed on the real scans: every held-out photo, from starts a stated distance off, against the known poses.

    .venv/bin/python benchmarks/real_scenes.py [--scenes fox monstree] [--starts near far] [--seeds N]

Needs the scans in ../shared/scenes (see the README); errors are per cent of the scan's median depth and degrees.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from core.cameras.files import read_cameras
from core.geometry.camera import Camera, pose_error
from core.photos.photo import read_photo
from core.pose.refine import refine
from core.pose.report import RefineReport
from core.pose.settings import RefineSettings
from core.render import ProcessRenderer, Renderer, RenderSettings
from core.splats import read_splats
from core.splats.scene import GaussianScene
from core.synthetic import perturb_camera

SCENES = ROOT.parent / "shared" / "scenes"
STARTS = {"near": (0.05, 4.0), "far": (0.30, 20.0), "hard": (0.50, 30.0)}  # share of the median depth, degrees
BOUNDS = {"near": (0.3, 0.2), "far": (0.5, 0.3), "hard": (0.5, 0.3)}  # per cent, degrees: what counts as home


@dataclass(frozen=True)
class Trial:
    """One photo refined once: errors in per cent of the median depth and degrees, the report, and the peak memory until then
    of the other processes that drew for it, GB.
    """

    name: str
    distance: float
    degrees: float
    report: RefineReport
    others_gb: float


def start_camera(truth: Camera, depth: float, ratio: float, degrees: float, seed: int) -> Camera:
    """`truth` moved by exactly `ratio` x `depth` and turned by exactly `degrees`, both in a random direction."""
    return perturb_camera(truth, ratio * depth, degrees, seed)


@dataclass(frozen=True)
class Scan:
    """A scan: Gaussians, held-out cameras, median depth; and a renderer on one thread, made where it is used."""

    name: str
    scene: GaussianScene
    cameras: list[Camera]
    depth: float

    @classmethod
    def load(cls, name: str) -> Scan:
        folder = SCENES / name
        scene = read_splats(folder / "scene.ply")
        depth = json.loads((folder / "queries.json").read_text())["median_depth"]
        return cls(name, scene, read_cameras(folder / "queries.json"), depth)

    @cached_property
    def renderer(self) -> Renderer:
        return Renderer(self.scene, RenderSettings(threads=1))


def run_scene(name: str, start: str, settings: RefineSettings, seeds: int) -> list[Trial]:
    scan, trials = Scan.load(name), []
    with ProcessRenderer(scan.scene, RenderSettings(threads=settings.threads)) as renderer:
        for index, truth in enumerate(scan.cameras):
            photo = read_photo(SCENES / name / truth.file)
            for seed in range(seeds):
                camera = start_camera(truth, scan.depth, *STARTS[start], seed=index + 100 * seed)
                report = refine(renderer, photo, camera, replace(settings, seed=seed))
                distance, degrees = pose_error(report.camera.pose, truth.pose)
                trials.append(Trial(Path(truth.file).stem, 100 * distance / scan.depth, degrees, report, children_gb()))
    return trials


def children_gb() -> float:
    """Peak memory of our living children together, GB (what they share is counted for each); 0 where no /proc tells."""
    pids = [pid for tasks in Path("/proc/self/task").glob("*/children") for pid in tasks.read_text().split()]
    lines = [line for pid in pids for line in Path(f"/proc/{pid}/status").read_text().splitlines()]
    return sum(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1e6


def row(scene: str, start: str, trials: list[Trial]) -> str:
    d, r = np.array([t.distance for t in trials]), np.array([t.degrees for t in trials])
    home = int(((d <= BOUNDS[start][0]) & (r <= BOUNDS[start][1])).sum())
    verdicts = [t.report.verdict for t in trials]
    lost = [t for t in trials if t.distance > BOUNDS[start][0] or t.degrees > BOUNDS[start][1]]
    wrong = sum(t.report.verdict == "trusted" for t in lost)
    seconds = np.array([t.report.seconds for t in trials])
    return (
        f"| {scene} | {start} | {np.median(d):.3f} / {np.median(r):.3f} | {d.max():.3f} / {r.max():.3f} "
        f"| {home} of {len(trials)} | {verdicts.count('trusted')} / {verdicts.count('check')} / {verdicts.count('failed')} "
        f"| {wrong} | {np.median(seconds):.1f} | {np.median([len(t.report.iterations) for t in trials]):.0f} |"
    )


HEADER = (
    "| scan | start | median error (% depth / deg) | largest | home | trusted / check / failed "
    "| lost but trusted | s per photo | iterations |\n|---|---|---|---|---|---|---|---|---|"
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["fox", "monstree"])
    parser.add_argument("--starts", nargs="+", choices=STARTS, default=["near", "far"])
    parser.add_argument("--seeds", type=int, default=1, help="starts per photo")
    parser.add_argument("--threads", type=int, default=0, help="0 = all cores")
    parser.add_argument("--json", type=Path, help="write every trial here")
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    print(HEADER, flush=True)
    dump, done = [], []
    for scene in args.scenes:
        for start in args.starts:
            trials = run_scene(scene, start, RefineSettings(threads=args.threads), args.seeds)
            print(row(scene, start, trials), flush=True)
            done += trials
            for t in trials:
                dump.append([scene, start, t.name, t.distance, t.degrees, t.report.verdict, t.report.seconds])
                if args.verbose:
                    print("  ", t.name, f"{t.distance:.3f} % {t.degrees:.3f} deg", t.report.verdict, *t.report.reasons)
    others = max((t.others_gb for t in done), default=0.0)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"\npeak memory {own:.2f} GB, and {others:.2f} GB of the processes that drew views for it")
    if args.json:
        args.json.write_text(json.dumps(dump, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
