"""Accuracy and speed on the real scans: every held-out photo, from starts a stated distance off, against the known poses.

    .venv/bin/python benchmarks/real_scenes.py [--scenes fox monstree] [--starts near far] [--lens given] [--seeds N]

--lens says what the refinement is told of the lens: "given" all of it, "focal" all but that its focal length is a guess 25 %
off (too long and too short by turns), "unknown" nothing: 55 degrees across the long side, as for a photo that tells nothing,
"wrong" a calibration with the focal length 3 % off, the principal point 2 % off and without the distortion.

Needs the scans in ../shared/scenes (see the README); errors are per cent of the scan's median depth and degrees.
"""

from __future__ import annotations

import argparse
import itertools
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
from core.geometry.camera import Camera, Intrinsics, pose_error
from core.photos.lens_guess import guess_lens_of_size
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
LENSES = ("given", "focal", "unknown", "wrong")
# Per cent and degrees, what counts as home: with the lens given, and without it.
BOUNDS = {"near": (0.3, 0.2), "far": (0.5, 0.3), "hard": (0.5, 0.3)}
BOUND_WITHOUT_LENS = (1.0, 1.0)


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


def told(truth: Camera, lens: str, index: int) -> Camera:
    """`truth` with what the refinement is told of its lens (see --lens above); `index` picks to which side it is off."""
    k, sign = truth.intrinsics, 1 if index % 2 else -1
    if lens == "unknown":
        return replace(truth, intrinsics=guess_lens_of_size(k.width, k.height).intrinsics, focal_guessed=True)
    if lens == "focal":
        factor = 1.25 if index % 2 else 0.8
        return replace(truth, intrinsics=replace(k, fx=k.fx * factor, fy=k.fy * factor), focal_guessed=True)
    if lens == "wrong":
        factor, dx, dy = 1 + 0.03 * sign, 0.02 * k.width * sign, 0.02 * k.height * (1 if index % 4 < 2 else -1)
        off = Intrinsics(k.width, k.height, k.fx * factor, k.fy * factor, k.cx + dx, k.cy + dy)
        return replace(truth, intrinsics=off)
    return truth


def run_scene(name: str, start: str, lens: str, settings: RefineSettings, seeds: int) -> list[Trial]:
    scan, trials = Scan.load(name), []
    with ProcessRenderer(scan.scene, RenderSettings(threads=settings.threads)) as renderer:
        for index, truth in enumerate(scan.cameras):
            photo = read_photo(SCENES / name / truth.file)
            for seed in range(seeds):
                camera = start_camera(told(truth, lens, index), scan.depth, *STARTS[start], seed=index + 100 * seed)
                report = refine(renderer, photo, camera, replace(settings, seed=seed))
                distance, degrees = pose_error(report.camera.pose, truth.pose)
                trials.append(Trial(Path(truth.file).stem, 100 * distance / scan.depth, degrees, report, children_gb()))
    return trials


def children_gb() -> float:
    """Peak memory of our living children together, GB (what they share is counted for each); 0 where no /proc tells."""
    pids = [pid for tasks in Path("/proc/self/task").glob("*/children") for pid in tasks.read_text().split()]
    lines = [line for pid in pids for line in Path(f"/proc/{pid}/status").read_text().splitlines()]
    return sum(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1e6


def row(name: str, bound: tuple[float, float], trials: list[Trial]) -> str:
    """A row of the table: `name` is its first cells, `bound` (per cent, degrees) what counts as home."""
    d, r = np.array([t.distance for t in trials]), np.array([t.degrees for t in trials])
    away = (d > bound[0]) | (r > bound[1])
    verdicts = [t.report.verdict for t in trials]
    wrong = sum(bool(lost) and verdict == "trusted" for lost, verdict in zip(away, verdicts, strict=True))
    seconds = np.array([t.report.seconds for t in trials])
    return (
        f"| {name} | {np.median(d):.3f} / {np.median(r):.3f} | {d.max():.3f} / {r.max():.3f} "
        f"| {len(trials) - away.sum()} of {len(trials)} "
        f"| {verdicts.count('trusted')} / {verdicts.count('check')} / {verdicts.count('failed')} | {wrong} "
        f"| {in_deviations(trials)} | {np.median(seconds):.1f} | {np.median([len(t.report.iterations) for t in trials]):.0f} |"
    )


def in_deviations(trials: list[Trial]) -> str:
    """RMS of the errors of position and rotation in the deviations that were stated, of the poses that were handed out."""
    handed = [(t, t.report.quality) for t in trials if t.report.quality and t.report.quality.of == "refined"]
    ratios = [(t.distance / q.translation_std_pct, t.degrees / q.rotation_std_deg) for t, q in handed]
    return "{:.2f} / {:.2f}".format(*np.sqrt(np.mean(np.square(ratios), axis=0))) if ratios else "none"


HEADER = (
    "| scan | start | lens | median error (% depth / deg) | largest | home | trusted / check / failed "
    "| lost but trusted | errors in stated deviations | s per photo | iterations |\n" + "|---" * 11 + "|"
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["fox", "monstree"])
    parser.add_argument("--starts", nargs="+", choices=STARTS, default=["near", "far"])
    parser.add_argument("--lens", nargs="+", choices=LENSES, default=["given"], help="what is told of the lens")
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
    for scene, lens, start in itertools.product(args.scenes, args.lens, args.starts):
        trials = run_scene(scene, start, lens, RefineSettings(threads=args.threads), args.seeds)
        bound = BOUNDS[start] if lens == "given" else BOUND_WITHOUT_LENS
        print(row(f"{scene} | {start} | {lens}", bound, trials), flush=True)
        done += trials
        for t in trials:
            dump.append([scene, start, lens, t.name, t.distance, t.degrees, t.report.verdict, t.report.seconds])
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
