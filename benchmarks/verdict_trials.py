"""How far the verdict can be trusted: hundreds of refinements, good and hopeless, against the known poses.

    .venv/bin/python benchmarks/verdict_trials.py [--out TRIALS.json] [--workers N] [--judge-again]

Every held-out photo of the scans in ../shared/scenes, from near to hopeless starts, as it is and spoilt: mirrored, 40 % of it
covered, most of it behind foreground objects, too dark, too bright, lit from one side, blurred, filled with a repeated
texture, taken from the other scan, or of a place that was cut out of the scan. Prints the table of verdicts against the truth.
A pose is right within 1 % of the median depth and 1 deg; a photo that is not of the place has no right pose. --judge-again
applies the verdict's rules of today to the evidence in TRIALS.json.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from real_scenes import SCENES, STARTS, Scan, start_camera
from spoilers import NO_TRUTH, SPOILERS

from core.cameras.files import read_cameras
from core.geometry.camera import Camera, Pose, pose_error
from core.photos.photo import Photo, read_photo
from core.pose.refine import refine
from core.pose.report import PoseQuality
from core.pose.report_json import quality_to_dict
from core.pose.settings import RefineSettings
from core.pose.verdict.verdict import judge
from core.render import Renderer, RenderSettings

RIGHT = (1.0, 1.0)  # per cent of the median depth, degrees
ALL_STARTS = {**STARTS, "hopeless": (1.5, 90.0)}
OTHER = {"fox": "monstree", "monstree": "fox"}
CUT_MARGIN = 0.1  # of the image's sides, beyond which the scan is left as it is


def plan() -> Iterator[tuple[str, str, str, int]]:
    """(scene, spoiler, start, seed) of every batch of photos."""
    for scene in OTHER:
        for start in ALL_STARTS:
            for seed in (1, 2) if start != "hopeless" else (1,):
                yield scene, "as it is", start, seed
        for spoiler in list(SPOILERS)[1:]:
            for start in ("near", "far"):
                yield scene, spoiler, start, 3


def without(scan: Scan, camera: Camera) -> Renderer:
    """The scan without all that `camera` sees, and a margin around it."""
    k = camera.intrinsics
    pixels = k.pinhole().project(camera.pose.transform(scan.scene.means))
    margin = CUT_MARGIN * np.array([k.width, k.height])
    with np.errstate(invalid="ignore"):
        seen = ((pixels > -margin) & (pixels < np.array([k.width, k.height]) + margin)).all(axis=1)
    columns = {f.name: getattr(scan.scene, f.name) for f in fields(scan.scene)}
    rest = {name: column[~seen] for name, column in columns.items() if isinstance(column, np.ndarray)}
    return Renderer(replace(scan.scene, **rest), RenderSettings(threads=1))


def run(scan: Scan, spoiler: str, start: str, seed: int) -> Iterator[dict[str, object]]:
    others = read_cameras(SCENES / OTHER[scan.name] / "queries.json")
    for index, truth in enumerate(scan.cameras):
        camera = start_camera(truth, scan.depth, *ALL_STARTS[start], seed=index + 100 * seed)
        source = SCENES / scan.name / truth.file
        if spoiler == "other scan":
            other = others[index % len(others)]
            source, camera = SCENES / OTHER[scan.name] / other.file, replace(camera, intrinsics=other.intrinsics)
        photo = Photo(SPOILERS[spoiler](read_photo(source).pixels, np.random.default_rng(index), scan.name))
        renderer = without(scan, truth) if spoiler == "cut out of the scan" else scan.renderer
        report = refine(renderer, photo, camera, RefineSettings(seed=seed, threads=1))
        # what "failed" held back counts too, or the verdict would look better for holding back right poses
        held_back = report.verdict == "failed" and report.iterations
        distance, degrees = pose_error(report.iterations[-1].pose if held_back else report.camera.pose, truth.pose)
        right = spoiler not in NO_TRUTH and 100 * distance / scan.depth <= RIGHT[0] and degrees <= RIGHT[1]
        yield {
            "scene": scan.name,
            "photo": Path(truth.file).stem,
            "spoiler": spoiler,
            "start": start,
            "distance": 100 * distance / scan.depth,
            "degrees": degrees,
            "right": right,
            "verdict": report.verdict,
            "seconds": report.seconds,
            "reasons": report.reasons,
            "quality": quality_to_dict(report.quality) if report.quality else None,
        }


def batch(job: tuple[str, str, str, int]) -> list[dict[str, object]]:
    """All photos of one batch, in a worker process."""
    cv2.setNumThreads(1)
    name, spoiler, start, seed = job
    return [{**row, "batch_seed": seed} for row in run(Scan.load(name), spoiler, start, seed)]


def table(rows: list[dict[str, object]]) -> str:
    out = [
        "| photo | start | trials | right | trusted & right | trusted & wrong | check | failed |",
        "|---|---|---|---|---|---|---|---|",
    ]
    groups = sorted({(str(r["spoiler"]), str(r["start"])) for r in rows}, key=lambda g: (list(SPOILERS).index(g[0]), g[1]))
    for spoiler, start in groups:
        out.append(_counts(f"{spoiler} | {start}", [r for r in rows if r["spoiler"] == spoiler and r["start"] == start]))
    out.append(_counts("all | all", rows))
    trusted = [r for r in rows if r["verdict"] == "trusted"]
    right = [r for r in rows if r["right"]]
    wrong = sum(not r["right"] for r in trusted)
    kept = sum(r["verdict"] == "trusted" for r in right)
    out.append(f"\nOf {len(trusted)} poses called trusted, {wrong} are wrong ({100 * wrong / max(1, len(trusted)):.1f} %).")
    out.append(f"Of {len(right)} right poses, {kept} are called trusted ({100 * kept / max(1, len(right)):.1f} %).")
    return "\n".join(out)


def _counts(name: str, rows: list[dict[str, object]]) -> str:
    right = [r for r in rows if r["right"]]
    trusted = [r for r in rows if r["verdict"] == "trusted"]
    verdicts = [r["verdict"] for r in rows]
    good = sum(bool(r["right"]) for r in trusted)
    return (
        f"| {name} | {len(rows)} | {len(right)} | {good} | {len(trusted) - good} "
        f"| {verdicts.count('check')} | {verdicts.count('failed')} |"
    )


def quality_from(data: dict[str, Any]) -> PoseQuality:
    """The evidence that `quality_to_dict` wrote; what JSON cannot hold is NaN."""
    pose = Pose(np.array(data["pose"]["R"]), np.array(data["pose"]["t"]))
    return PoseQuality(**{k: math.nan if v is None else v for k, v in data.items() if k != "pose"}, pose=pose)


def judged_again(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """The same evidence under the verdict's rules of today; where there was none, the verdict stays."""
    return [{**r, "verdict": judge(quality_from(r["quality"]))[0]} if r["quality"] else r for r in rows]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="write every trial here; a second run goes on where the first stopped")
    parser.add_argument("--workers", type=int, default=2, help="processes side by side")
    parser.add_argument("--judge-again", action="store_true", help="no new trials: today's rules on the evidence in --out")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    rows: list[dict[str, object]] = json.loads(args.out.read_text()) if args.out and args.out.exists() else []
    if args.judge_again:
        print(table(judged_again(rows)))
        return 0
    done = {(r["scene"], r["spoiler"], r["start"], r["batch_seed"]) for r in rows}
    with ProcessPoolExecutor(args.workers) as pool:
        for found in pool.map(batch, [job for job in plan() if job not in done]):
            rows += found
            if args.out:
                args.out.write_text(json.dumps(rows, indent=1))
            print(f"{len(rows)} trials", file=sys.stderr, flush=True)
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
