"""What sharing a lens brings: the held-out photos of the real scans in a batch that is told nothing of their lens.

    .venv/bin/python benchmarks/shared_lens.py [--scenes fox] [--start near] [--workers 2] [--keep FOLDER]

Each photo's own answer is compared with the one under the shared lens. Needs the scans in ../shared/scenes (see the README);
errors are per cent of the scan's median depth and degrees, of the focal length per cent, of the principal point pixels.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(Path(__file__).resolve().parent)]

from real_scenes import SCENES, STARTS, start_camera

from core.cameras.files import camera_from_dict, read_cameras
from core.cli.main import main as command_line
from core.geometry.camera import Camera, pose_error
from core.pose.shared_records import own_record

HEADER = (
    "| scan | lens | median error (% depth / deg) | largest | focal length, median (largest) % | principal point px "
    "| trusted / check / failed | errors in stated deviations |\n" + "|---" * 8 + "|"
)


def starts(folder: Path, start: str, depth: float) -> list[dict[str, Any]]:
    """Records of starts without a lens, each a stated distance from the truth."""
    truths = read_cameras(folder / "queries.json")
    moved = [start_camera(truth, depth, *STARTS[start], seed=index).pose for index, truth in enumerate(truths)]
    return [
        {"file": str((folder / truth.file).resolve()), "R": pose.R.tolist(), "t": pose.t.tolist()}
        for truth, pose in zip(truths, moved, strict=True)
    ]


def row(name: str, records: list[dict[str, Any]], truths: list[Camera], depth: float) -> str:
    """A row of the table over the photos that were placed; `name` is its first cells."""
    verdicts = Counter(record["verdict"] for record in records)
    placed = [(r, camera_from_dict(r), t) for r, t in zip(records, truths, strict=True) if r["verdict"] != "failed"]
    errors = np.array([pose_error(camera.pose, truth.pose) for _, camera, truth in placed]) * (100 / depth, 1.0)
    focal = np.array([100 * abs(c.intrinsics.focal / t.intrinsics.focal - 1) for _, c, t in placed])
    off = [(c.intrinsics.cx - t.intrinsics.cx, c.intrinsics.cy - t.intrinsics.cy) for _, c, t in placed]
    stated = np.array([(r["quality"]["translation_std_pct"], r["quality"]["rotation_std_deg"]) for r, _, _ in placed], float)
    ratio = np.sqrt(np.mean(np.square(errors / stated), axis=0))
    (pct, deg), (most_pct, most_deg) = np.median(errors, axis=0), errors.max(axis=0)
    return (
        f"| {name} | {pct:.3f} / {deg:.3f} | {most_pct:.3f} / {most_deg:.3f} | {np.median(focal):.3f} ({focal.max():.3f}) "
        f"| {np.median(np.linalg.norm(off, axis=1)):.2f} | {verdicts['trusted']} / {verdicts['check']} / {verdicts['failed']} "
        f"| {ratio[0]:.2f} / {ratio[1]:.2f} |"
    )


def run(name: str, start: str, workers: int, place: Path) -> None:
    folder = SCENES / name
    depth = json.loads((folder / "queries.json").read_text())["median_depth"]
    queries, out = place / f"{name}_{start}.json", place / f"{name}_{start}_results.json"
    queries.write_text(json.dumps({"frames": starts(folder, start, depth)}))
    argv = ["batch", folder / "scene.ply", queries, "--out", out, "--no-locate", "--workers", workers, "--shared-lens", "one"]
    command_line([str(word) for word in argv])
    records, truths = json.loads(out.read_text())["frames"], read_cameras(folder / "queries.json")
    print(row(f"{name}, {start} | each its own", [own_record(r) for r in records], truths, depth))
    print(row(f"{name}, {start} | shared", records, truths, depth), flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["fox"])
    parser.add_argument("--start", choices=STARTS, default="near")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder in which the results stay; a second run goes on with them")
    args = parser.parse_args()
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    print(HEADER, flush=True)
    with tempfile.TemporaryDirectory() as folder:
        place = args.keep or Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        for name in args.scenes:
            run(name, args.start, args.workers, place)
    return 0


if __name__ == "__main__":
    sys.exit(main())
