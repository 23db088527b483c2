"""The paper's ablations and ours on the real scans, as tables and a plot.

    .venv/bin/python benchmarks/ablations.py [--plot benchmarks/iterations.png] [--workers N] [--only NAME ...]

Groups: stages (no multi-view, no epipolar, every last stage), candidates (L = 1 .. 12), perturbation (size of the fan),
iterations (the error after each one, as the plot), lens (a focal length 25 % off), distortion (nobody told of it). Needs the
scans in ../shared/scenes; errors are per cent of the scan's median depth and degrees. Seconds are real_scenes.py's: two
processes here share the machine.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from real_scenes import BOUNDS, SCENES, STARTS, Scan, start_camera

from core.geometry.camera import pose_error
from core.photos.photo import read_photo
from core.pose.refine import refine
from core.pose.settings import RefineSettings

SCANS = ("fox", "monstree")
MAX_ITERATIONS = 6  # of the curve
LENS_GROUPS = ("lens", "distortion")
LOOP = {"final": "none"}  # the paper's method ends with its loop


@dataclass(frozen=True)
class Variant:
    """One row of a table: `settings` over the defaults, from `start`; `focal` is what the lens is multiplied by, `told` whether
    its distortion is known, `guessed` whether the camera says that its lens is a guess.
    """

    group: str
    name: str
    start: str
    settings: dict[str, object]
    focal: float = 1.0
    told: bool = True
    guessed: bool = False


@dataclass(frozen=True)
class Result:
    """One photo: errors at the end, (iteration, 2) errors after every iteration, relative focal error and verdict."""

    error: tuple[float, float]
    curve: list[tuple[float, float]]
    focal: float
    verdict: str


def variants() -> list[Variant]:
    out = []
    for start in ("near", "far"):
        out += [
            Variant("stages", "the loop, no multi-view", start, {**LOOP, "multiview": False}),
            Variant("stages", "the loop, no epipolar", start, {**LOOP, "epipolar": False}),
            Variant("stages", "the loop (the paper's stages)", start, LOOP),
        ]
        out += [Variant("stages", f"last stage: {f}", start, {"final": f}) for f in ("epipolar", "depth", "joint", "auto")]
    out += [Variant("candidates", f"L = {n}", "far", {**LOOP, "candidates": n}) for n in (1, 2, 3, 4, 6, 8, 12)]
    out += [Variant("perturbation", f"{100 * r:g} % of depth", "far", {**LOOP, "perturb_translation_ratio": r}) for r in RATIOS]
    out += [Variant("perturbation", f"{d:g} deg", "far", {**LOOP, "perturb_rotation_deg": d}) for d in (0.01, 2.0, 5.0)]
    out += [Variant("iterations", start, start, {**LOOP, "iterations": MAX_ITERATIONS}) for start in STARTS]
    for start in ("near", "far"):
        out += [Variant("lens", f"focal x {f:g}, --lens focal", start, {"lens": "focal"}, f) for f in (0.75, 1.25)]
    out.append(Variant("lens", "focal x 1.25, --lens fixed", "near", {"lens": "fixed"}, 1.25))
    for name, guessed in (("a guess", True), ("said to be calibrated", False)):
        out.append(Variant("distortion", f"untold, the lens {name}", "near", {}, told=False, guessed=guessed))
    return out


RATIOS = (0.01, 0.02, 0.045, 0.09, 0.18)


@lru_cache(maxsize=2)
def scan(name: str) -> Scan:
    cv2.setNumThreads(1)
    return Scan.load(name)


def measure(job: tuple[Variant, str, int]) -> Result:
    """One photo of one variant, in a worker process."""
    variant, name, index = job
    here = scan(name)
    truth = here.cameras[index]
    camera = start_camera(truth, here.depth, *STARTS[variant.start], seed=index)
    k = camera.intrinsics
    k = replace(k if variant.told else k.pinhole(), fx=k.fx * variant.focal, fy=k.fy * variant.focal)
    camera = replace(camera, intrinsics=k, focal_guessed=variant.guessed)
    settings = RefineSettings(seed=0, threads=1, **variant.settings)
    report = refine(here.renderer, read_photo(SCENES / name / truth.file), camera, settings)

    def error(pose: object) -> tuple[float, float]:
        distance, degrees = pose_error(pose, truth.pose)
        return 100 * distance / here.depth, degrees

    focal = 100 * abs(report.camera.intrinsics.focal / truth.intrinsics.focal - 1)
    curve = [error(camera.pose), *(error(record.pose) for record in report.iterations)]
    return Result(error(report.camera.pose), curve, focal, report.verdict)


def row(variant: Variant, name: str, results: list[Result]) -> str:
    e = np.array([r.error for r in results])
    home = int((e <= BOUNDS[variant.start]).all(1).sum())
    verdicts = [r.verdict for r in results]
    counts = " / ".join(str(verdicts.count(v)) for v in ("trusted", "check", "failed"))
    focal = f" {np.median([r.focal for r in results]):.2f} |" if variant.group in LENS_GROUPS else ""
    median, largest = np.median(e, axis=0), e.max(axis=0)
    errors = f"{median[0]:.3f} / {median[1]:.3f} | {largest[0]:.3f} / {largest[1]:.3f}"
    return f"| {variant.name} | {name} | {variant.start} | {errors} | {home} of {len(results)} | {counts} |{focal}"


def header(group: str) -> str:
    focal = " focal error, % |" if group in LENS_GROUPS else ""
    names = "| variant | scan | start | median (% depth / deg) | largest | home | trusted / check / failed |"
    return f"\n### {group}\n\n{names}{focal}\n" + "|---" * (8 if focal else 7) + "|"


def plot(curves: dict[tuple[str, str], list[Result]], file: Path) -> None:
    """The median error after each iteration; a refinement that stopped stays where it stopped."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    for (start, name), results in curves.items():
        held = np.array([[r.curve[min(i, len(r.curve) - 1)] for i in range(MAX_ITERATIONS + 1)] for r in results])
        for axis, k in zip(axes, (0, 1), strict=True):
            axis.semilogy(np.median(held[:, :, k], axis=0), marker="o", ms=3, label=f"{name}, {start}")
    for axis, unit in zip(axes, ("% of the median depth", "degrees"), strict=True):
        axis.set(xlabel="iterations of the loop", ylabel=f"median error, {unit}")
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=110)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plot", type=Path, default=ROOT / "benchmarks" / "iterations.png")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", help="these groups")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    group, curves = "", {}
    with ProcessPoolExecutor(args.workers) as pool:
        for variant in variants():
            if args.only and variant.group not in args.only:
                continue
            if variant.group != group:
                group = variant.group
                print(header(group), flush=True)
            for name in SCANS:
                jobs = [(variant, name, index) for index in range(len(scan(name).cameras))]
                results = list(pool.map(measure, jobs))
                print(row(variant, name, results), flush=True)
                if group == "iterations":
                    curves[variant.start, name] = results
    if curves:
        plot(curves, args.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
