"""Features and matchers compared on the real scans: who comes home from how far, how exactly, and how fast.

    .venv/bin/python benchmarks/features.py [--features sift aliked-t16 auto ...] [--starts near far hard] [--seeds 2]
    .venv/bin/python benchmarks/features.py --speed

Needs the scans in ../shared/scenes and, for learned features, their models in ../shared/models (or --models DIR); features
whose model is not there are left out and named. Starts, errors and bounds are those of real_scenes.py, both scans together.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from real_scenes import BOUNDS, SCENES, STARTS, Trial, run_scene

from core.features.frontend import make_frontend
from core.features.registry import AUTO
from core.photos.photo import read_photo
from core.pose.settings import RefineSettings

ROUNDS = 7
T16, N16 = "aliked-t16-top2048.onnx", "aliked-n16rot-top2048.onnx"


@dataclass(frozen=True)
class Row:
    """One line of the table: what --features calls it, and the settings' fields with their model file names."""

    features: str
    model: str = ""


ROWS = {
    "sift": Row("sift"),
    "akaze": Row("akaze"),
    "orb": Row("orb"),
    "aliked-t16": Row("aliked", T16),
    "aliked-n16rot": Row("aliked", N16),
    "auto": Row("auto", T16),
}

HEADER = (
    "| features | start | home | median error (% depth / deg) | trusted / check / failed | lost but trusted | s per photo "
    "| iterations |\n|---|---|---|---|---|---|---|---|"
)


def line(name: str, start: str, trials: list[Trial]) -> str:
    far, turn = BOUNDS[start]
    home = [t for t in trials if t.distance <= far and t.degrees <= turn]
    lost_but_trusted = sum(t.report.verdict == "trusted" for t in trials if t not in home)
    verdicts = [t.report.verdict for t in trials]
    d, r = (np.median([getattr(t, what) for t in home] or [np.nan]) for what in ("distance", "degrees"))
    return (
        f"| {name} | {start} | {len(home)} of {len(trials)} ({100 * len(home) / len(trials):.0f} %) | {d:.3f} / {r:.3f} "
        f"| {verdicts.count('trusted')} / {verdicts.count('check')} / {verdicts.count('failed')} | {lost_but_trusted} "
        f"| {np.median([t.report.seconds for t in trials]):.1f} | {np.mean([len(t.report.iterations) for t in trials]):.1f} |"
    )


def speed(models: Path) -> None:
    """Seconds for one photo at the refinement's size, in the process that a refinement would use."""
    path = sorted((SCENES / "fox" / "queries").iterdir())[0]
    grey = cv2.cvtColor(read_photo(path).pixels, cv2.COLOR_RGB2GRAY)
    grey = cv2.resize(grey, None, fx=640 / max(grey.shape), fy=640 / max(grey.shape), interpolation=cv2.INTER_AREA)
    print(f"| features of a photo of {grey.shape[1]} x {grey.shape[0]} | found | s |\n|---|---|---|")
    for name, row in ROWS.items():
        if row.features == AUTO or (row.model and not (models / row.model).is_file()):
            continue
        with make_frontend(
            RefineSettings(features=row.features, model=str(models / row.model) if row.model else "")
        ) as frontend:
            count, seconds = len(frontend.photo_features(grey)), []
            for _ in range(ROUNDS):
                began = time.perf_counter()
                frontend.photo_features(grey)
                seconds.append(time.perf_counter() - began)
        print(f"| {name} | {count} | {np.median(seconds):.2f} |", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--features", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--starts", nargs="+", choices=STARTS, default=list(STARTS))
    parser.add_argument("--scenes", nargs="+", default=["fox", "monstree"])
    parser.add_argument("--seeds", type=int, default=1, help="starts per photo")
    parser.add_argument("--threads", type=int, default=0, help="0 = all cores")
    parser.add_argument("--models", type=Path, default=SCENES.parent / "models", metavar="DIR")
    parser.add_argument("--speed", action="store_true", help="only how long each takes for one photo")
    parser.add_argument("--verbose", action="store_true")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    if args.speed:
        speed(args.models)
        return 0
    print(HEADER, flush=True)
    for name in args.features:
        row = ROWS[name]
        model = args.models / row.model if row.model else None
        if model is not None and not model.is_file():
            print(f"{name} is left out: no {model}", file=sys.stderr)
            continue
        settings = RefineSettings(features=row.features, model=str(model or ""), threads=args.threads)
        for start in args.starts:
            trials = [t for scene in args.scenes for t in run_scene(scene, start, "given", settings, args.seeds)]
            print(line(name, start, trials), flush=True)
            for t in trials if args.verbose else ():
                print("  ", t.name, f"{t.distance:.3f} % {t.degrees:.3f} deg", t.report.verdict, f"{t.report.seconds:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
