"""How far the verdict can be trusted: hundreds of refinements, good and hopeless, against the known poses.

    .venv/bin/python benchmarks/verdict_trials.py [--out TRIALS.json] [--workers N] [--judge-again] [--share 1.0]

Held-out photos of the scans in ../shared/scenes and of the procedural room, each with four things told of the lens (see
real_scenes.py): all of it, all but the focal length, nothing, and a wrong calibration that is called one. As they are, from
near, far and hopeless starts; and spoilt (see spoilers.py), each spoiler on some of the photos. Prints the verdicts against the
truth, for each kind of lens and for each spoiler, and the errors in units of the deviations that were stated. A pose is right
within 1 % of the median depth and 1 deg; a photo that is not of the place has no right pose.

Photos of even number are those that thresholds may be set on ("set"), the others those that they are reported on ("held out").
--judge-again applies the verdict's rules of today to the evidence in TRIALS.json; --share draws that part of the trials.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from real_scenes import LENSES, SCENES, STARTS, Scan, start_camera, told
from spoilers import NO_TRUTH, SPOILERS

from core.geometry.camera import Camera, Pose, pose_error
from core.photos.photo import Photo, read_photo
from core.pose.refine import refine
from core.pose.report import PoseQuality, RefineReport
from core.pose.report_json import quality_to_dict
from core.pose.settings import RefineSettings
from core.pose.verdict.verdict import judge
from core.render import Renderer, RenderSettings
from core.splats.scene import GaussianScene
from core.synthetic import make_scene
from core.synthetic.sample import DEPTH, make_photo, sample_cameras

RIGHT = (1.0, 1.0)  # per cent of the median depth, degrees
ALL_STARTS = {**STARTS, "hopeless": (1.5, 90.0)}
OTHER = {"fox": "monstree", "monstree": "room", "room": "fox", "sample": "fox"}
SAMPLE_GAUSSIANS = 40_000
# Every so many photos of a scan are spoilt in one way, and others in the next way.
SPOILT_EVERY = 4
# What further draws for a photo add to the seeds.
AGAIN = 10_000
CUT_MARGIN = 0.1  # of the image's sides, beyond which the scan is left as it is
Row = dict[str, Any]


@dataclass(frozen=True)
class Trial:
    """One refinement to make: which photo of which scan, what is told of its lens, how it is spoilt, from which start; `again`
    counts further starts and lenses drawn for the same photo.
    """

    scene: str
    photo: int
    lens: str
    spoiler: str
    start: str
    again: int = 0

    @property
    def seed(self) -> int:
        return self.photo + 100 * list(ALL_STARTS).index(self.start) + AGAIN * self.again


@cache
def scan_of(name: str) -> Scan:
    """A scan in ../shared/scenes, or the procedural room with its cameras."""
    if name != "sample":
        return Scan.load(name)
    return Scan("sample", make_scene(gaussians=SAMPLE_GAUSSIANS), sample_cameras(6), DEPTH)


@cache
def photo_of(name: str, index: int) -> Photo:
    scan = scan_of(name)
    truth = scan.cameras[index]
    return make_photo(scan.renderer, truth, index) if name == "sample" else read_photo(SCENES / name / truth.file)


def plan() -> list[Trial]:
    """All trials: those of photos as they are first, then the spoilt ones in an order drawn at random, so that a part of them
    is of all kinds.
    """
    out = []
    photos = [(name, i) for name in OTHER for i in range(len(scan_of(name).cameras))]
    for start in ("near", "far"):
        out += [Trial(*photo, lens, "as it is", start) for photo in photos for lens in LENSES]
    out += [Trial(*photo, LENSES[n % len(LENSES)], "as it is", "hopeless") for n, photo in enumerate(photos)]
    for start in ("near", "far"):
        out += [Trial(*photo, lens, "as it is", start, 1) for photo in photos for lens in LENSES]
    spoilt = []
    for way, spoiler in enumerate(list(SPOILERS)[1:]):
        for n, photo in enumerate(photos):
            if (n + way) % SPOILT_EVERY == 0:
                spoilt += [Trial(*photo, lens, spoiler, "near") for lens in LENSES]
    return [*out, *(spoilt[i] for i in np.random.default_rng(1).permutation(len(spoilt)))]


def without(scan: Scan, camera: Camera) -> Renderer:
    """The scan without all that `camera` sees, and a margin around it."""
    k = camera.intrinsics
    pixels = k.pinhole().project(camera.pose.transform(scan.scene.means))
    margin = CUT_MARGIN * np.array([k.width, k.height])
    with np.errstate(invalid="ignore"):
        seen = ((pixels > -margin) & (pixels < np.array([k.width, k.height]) + margin)).all(axis=1)
    return Renderer(part_of(scan.scene, ~seen), RenderSettings(threads=1))


def part_of(scene: GaussianScene, keep: np.ndarray) -> GaussianScene:
    columns = {f.name: getattr(scene, f.name) for f in fields(scene)}
    return replace(scene, **{name: column[keep] for name, column in columns.items() if isinstance(column, np.ndarray)})


def run(trial: Trial) -> Row:
    cv2.setNumThreads(1)
    scan = scan_of(trial.scene)
    truth = scan.cameras[trial.photo]
    camera = start_camera(
        told(truth, trial.lens, trial.photo + AGAIN * trial.again), scan.depth, *ALL_STARTS[trial.start], seed=trial.seed
    )
    photo = photo_of(trial.scene, trial.photo)
    if trial.spoiler == "other scan":
        other = scan_of(OTHER[trial.scene])
        index = trial.photo % len(other.cameras)
        photo = photo_of(OTHER[trial.scene], index)
        camera = replace(camera, intrinsics=told(other.cameras[index], trial.lens, trial.photo).intrinsics)
    photo = Photo(SPOILERS[trial.spoiler](photo.pixels, np.random.default_rng(trial.photo), trial.scene))
    renderer = without(scan, truth) if trial.spoiler == "cut out of the scan" else scan.renderer
    report = refine(renderer, photo, camera, RefineSettings(seed=trial.seed, threads=1))
    return row_of(trial, truth, scan.depth, report)


def row_of(trial: Trial, truth: Camera, depth: float, report: RefineReport) -> Row:
    # What "failed" held back counts too, or the verdict would look better for holding back right poses.
    held_back = report.verdict == "failed" and report.quality is not None
    pose = report.quality.pose if held_back else report.camera.pose
    distance, degrees = pose_error(pose, truth.pose)
    has_truth = trial.spoiler not in NO_TRUTH
    k, true = report.camera.intrinsics, truth.intrinsics
    off = {"focal": k.focal - true.focal, "cx": k.cx - true.cx, "cy": k.cy - true.cy}
    return {
        **{f.name: getattr(trial, f.name) for f in fields(trial)},
        "distance": 100 * distance / depth,
        "degrees": degrees,
        "right": bool(has_truth and 100 * distance / depth <= RIGHT[0] and degrees <= RIGHT[1]),
        "verdict": report.verdict,
        "seconds": report.seconds,
        "reasons": report.reasons,
        "lens_in_deviations": {n.name: off[n.name] / n.std for n in report.lens if n.name in off and n.state != "given"},
        "quality": quality_to_dict(report.quality) if report.quality else None,
    }


def key(row: Row) -> Trial:
    return Trial(*(row.get(f.name, 0) for f in fields(Trial)))


def report(rows: Sequence[Row]) -> str:
    """All tables."""
    heads = "| trials | right | trusted & right | trusted & wrong | check | failed | of trusted wrong | of right trusted |"
    out = ["| lens | photos " + heads, "|---" * 10 + "|"]
    halves = {"set": [r for r in rows if r["photo"] % 2 == 0], "held out": [r for r in rows if r["photo"] % 2]}
    for lens in (*LENSES, "all"):
        for half, part in halves.items():
            out.append(f"| {lens} | {half} " + counts([r for r in part if lens in (r["lens"], "all")]))
    out += ["", "| photo | start " + heads, "|---" * 10 + "|"]
    for spoiler in SPOILERS:
        for start in ALL_STARTS:
            chosen = [r for r in rows if (r["spoiler"], r["start"]) == (spoiler, start)]
            if chosen:
                out.append(f"| {spoiler} | {start} " + counts(chosen))
    out += ["", "| lens | poses handed out | " + " | ".join(f"{name}: RMS, within 2.5" for name in DEVIATIONS) + " |"]
    out.append("|---" * (2 + len(DEVIATIONS)) + "|")
    return "\n".join([*out, *(f"| {lens} {calibration(rows, lens)}" for lens in LENSES)])


def counts(rows: Sequence[Row]) -> str:
    right = [r for r in rows if r["right"]]
    trusted = [r for r in rows if r["verdict"] == "trusted"]
    good, verdicts = sum(r["right"] for r in trusted), [r["verdict"] for r in rows]
    wrong, kept = len(trusted) - good, good / max(1, len(right))
    return (
        f"| {len(rows)} | {len(right)} | {good} | {wrong} | {verdicts.count('check')} | {verdicts.count('failed')} "
        f"| {100 * wrong / max(1, len(trusted)):.1f} % | {100 * kept:.0f} % |"
    )


DEVIATIONS = ("position", "rotation", "focal length", "principal point")


def calibration(rows: Sequence[Row], lens: str) -> str:
    """Errors in units of the deviations stated with them, of poses that were handed out for a photo of the place from a start
    that is not hopeless: RMS, and the share within 2.5.
    """
    chosen = [r for r in rows if r["lens"] == lens and r["verdict"] != "failed" and r["quality"]]
    chosen = [
        r for r in chosen if r["quality"]["of"] == "refined" and r["spoiler"] not in NO_TRUTH and r["start"] != "hopeless"
    ]
    ratios: dict[str, list[float]] = {name: [] for name in DEVIATIONS}
    for r in chosen:
        quality, numbers = r["quality"], r["lens_in_deviations"]
        ratios["position"].append(r["distance"] / (quality["translation_std_pct"] or math.inf))
        ratios["rotation"].append(r["degrees"] / (quality["rotation_std_deg"] or math.inf))
        ratios["focal length"] += [numbers["focal"]] if "focal" in numbers else []
        ratios["principal point"] += [numbers[name] for name in ("cx", "cy") if name in numbers]
    cells = [
        f"{np.sqrt(np.mean(np.square(v))):.2f}, {100 * np.mean(np.abs(v) < 2.5):.0f} %" if v else "given"
        for v in ratios.values()
    ]
    return f"| {len(chosen)} | " + " | ".join(cells) + " |"


def quality_from(data: Row) -> PoseQuality:
    """The evidence that `quality_to_dict` wrote; what JSON cannot hold is NaN."""
    pose = Pose(np.array(data["pose"]["R"]), np.array(data["pose"]["t"]))
    return PoseQuality(**{k: math.nan if v is None else v for k, v in data.items() if k != "pose"}, pose=pose)


def judged_again(rows: Sequence[Row]) -> list[Row]:
    """The same evidence under the verdict's rules of today; where there was none, or the start was kept, the verdict stays."""

    def again(row: Row) -> Row:
        quality = row["quality"]
        judged = quality is not None and quality["of"] != "start"
        return {**row, "verdict": judge(quality_from(quality))[0]} if judged else row

    return [again(row) for row in rows]


def trials(args: argparse.Namespace, rows: list[Row]) -> Iterator[Row]:
    done = {key(row) for row in rows}
    wanted = plan()
    keep = np.random.default_rng(0).random(len(wanted)) < args.share
    left = [trial for trial, kept in zip(wanted, keep, strict=True) if kept and trial not in done]
    with ProcessPoolExecutor(args.workers) as pool:
        yield from pool.map(run, left)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="write every trial here; a second run goes on where the first stopped")
    parser.add_argument("--workers", type=int, default=2, help="processes side by side")
    parser.add_argument("--share", type=float, default=1.0, help="which part of the trials is made, drawn at random")
    parser.add_argument("--judge-again", action="store_true", help="no new trials: today's rules on the evidence in --out")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    lines = args.out.read_text().splitlines() if args.out and args.out.exists() else []
    rows: list[Row] = [json.loads(line) for line in lines]
    if args.judge_again:
        print(report(judged_again(rows)))
        return 0
    for row in trials(args, rows):
        rows.append(row)
        if args.out:
            with args.out.open("a") as file:
                file.write(json.dumps(row) + "\n")
        print(f"{len(rows)} trials", file=sys.stderr, flush=True)
    print(report(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
