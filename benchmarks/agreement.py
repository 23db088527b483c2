"""Can the verdict tell where a render sits on a photo, most of which is hidden?

    .venv/bin/python benchmarks/agreement.py [--scenes fox monstree room] [--out ROWS.json] [--judge-again]

No refinement takes part: the scan is drawn once at the right camera of each held-out photo in ../shared/scenes and at wrong
ones (moved and turned, of another photo, one window farther along a facade), and the photo, as it is and spoilt, is compared
with it as the verdict does. Prints how often the regions in which they agree would be trusted, to be checked or failed, were
all else beyond doubt. "Set on" are the photos that the thresholds were set on, "reported on" the others of each scan.

The right cameras of the fox and the tree are the true ones. Those of the room, whose true ones are only good to some tenths of
a per cent, come from a refinement of the photo as it is. The facades are made: a wall with windows that are more or less alike,
seen straight on and at a slant; the wrong camera stands one window farther.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from real_scenes import SCENES, Scan
from spoilers import SPOILERS, boxes

from core.geometry.camera import Camera, Intrinsics, Pose
from core.photos.photo import Photo, read_photo
from core.pose.refine import refine
from core.pose.report import PoseQuality
from core.pose.search.observe import grey_of
from core.pose.settings import RefineSettings
from core.pose.shared.surface import solid_part
from core.pose.shared.working import WorkingPhoto
from core.pose.verdict.regions import Region
from core.pose.verdict.verdict import judge
from core.pose.verdict.verify import FinalView, compare
from core.synthetic import perturb_camera

HIDDEN = ("40 % covered", "foreground 50 %", "foreground 70 %", "foreground 85 %")
LIGHT = ("as it is", "very dark", "blown out", "lit from one side", "blurred")
BOXES = {"boxes 70 %": boxes(0.70), "boxes 85 %": boxes(0.85)}
# How far wrong cameras are moved, per cent of the median depth, and turned, degrees.
MOVED = ((1.5, 0.5), (3.0, 2.0), (20.0, 12.0))
FACADE_LENS = Intrinsics(640, 480, 520.0, 520.0, 320.0, 240.0)
WINDOW_M = 2.0  # from one window of a facade to the next


@dataclass(frozen=True)
class Row:
    """One comparison: the region that was found, of how many corners, and the share of them that agrees."""

    scene: str
    photo: int
    spoiler: str
    camera: str
    corners: int
    agreement: float
    photo_px: float
    long_side: int
    region: dict[str, float]


def compared(scan: Scan, pose: Pose, truth: Camera, photos: dict[str, WorkingPhoto]) -> Iterator[tuple[str, FinalView]]:
    """Each of the spoilt photos of one place against the render at `pose`."""
    pinhole = next(iter(photos.values())).pinhole
    view = scan.renderer.render(pinhole, pose)
    grey, solid = grey_of(view), solid_part(view)
    for name, photo in photos.items():
        yield name, compare(photo, grey, solid)


def scan_rows(scan: Scan) -> Iterator[Row]:
    for index, truth in enumerate(scan.cameras):
        pixels = read_photo(SCENES / scan.name / truth.file).pixels
        spoilers = {name: SPOILERS[name] for name in (*LIGHT, *HIDDEN)} | BOXES
        photos = {}
        for number, (name, spoil) in enumerate(spoilers.items()):
            spoilt = spoil(pixels, np.random.default_rng(1000 * index + number), scan.name)
            photos[name] = WorkingPhoto.of(Photo(spoilt), truth.intrinsics, RefineSettings().long_side_px)
        for camera, pose in cameras_of(scan, index):
            for spoiler, seen in compared(scan, pose, truth, photos):
                yield row(scan.name, index, spoiler, camera, seen, max(truth.intrinsics.width, truth.intrinsics.height))


def row(scene: str, photo: int, spoiler: str, camera: str, seen: FinalView, long_side: int) -> Row:
    region = asdict(seen.region)
    return Row(scene, photo, spoiler, camera, seen.corners, seen.agreement, seen.photo_px, long_side, region)


def cameras_of(scan: Scan, index: int) -> Iterator[tuple[str, Pose]]:
    """The right camera of a photo, and wrong ones."""
    truth = scan.cameras[index]
    right = truth
    if scan.name == "room":
        photo = read_photo(SCENES / scan.name / truth.file)
        right = replace(truth, pose=refine(scan.renderer, photo, truth, RefineSettings(threads=1)).camera.pose)
    yield "right", right.pose
    for number, (per_cent, degrees) in enumerate(MOVED):
        moved = perturb_camera(right, per_cent / 100 * scan.depth, degrees, 10 * index + number)
        yield f"{per_cent:g} % / {degrees:g} deg off", moved.pose
    yield "of another photo", scan.cameras[(index + 1) % len(scan.cameras)].pose


def facade(unlike: float, rng: np.random.Generator) -> np.ndarray:
    """A wall, 100 pixels to the metre, with a window every WINDOW_M; `unlike`: how much each differs from the next."""
    h, w = 1600, 2400
    image = 150 + 24 * cv2.GaussianBlur(rng.normal(size=(h, w)), (0, 0), 2)
    alike, each = _blotches(rng), round(100 * WINDOW_M)
    for y in range(60, h - 160, 260):
        for x in range(50, w - 120, each):
            image[y - 8 : y + 160, x - 8 : x + 118] = 220
            image[y : y + 150, x : x + 110] = 80 + alike + unlike * (_blotches(rng) + 15 * rng.normal())
            image[y : y + 150, x + 53 : x + 57] = 210
    return np.clip(image, 0, 255).astype(np.float32)


def _blotches(rng: np.random.Generator) -> np.ndarray:
    noise = cv2.GaussianBlur(rng.normal(size=(150, 110)), (0, 0), 6)
    return np.asarray(30 * noise / noise.std())


def facade_view(wall: np.ndarray, x: float, yaw: float) -> np.ndarray:
    """The wall from 9 m before it, `x` metres along it, turned by `yaw` (radians)."""
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    t = -R @ np.array([x, 8.0, -9.0])
    homography = FACADE_LENS.matrix @ np.column_stack([R[:, 0], R[:, 1], t]) @ np.diag([0.01, 0.01, 1.0])
    return np.asarray(cv2.warpPerspective(wall, homography, (640, 480), flags=cv2.INTER_AREA))


def facade_rows() -> Iterator[Row]:
    """Facades of 10 kinds of windows, straight and at a slant; a splat shows them blurred, a photo with noise."""
    spoilers = {name: SPOILERS[name] for name in ("as it is", "foreground 50 %", "foreground 70 %")}
    for index in range(20):
        rng = np.random.default_rng(index)
        wall = facade(np.repeat([0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0, 1.2, 1.5], 2)[index], rng)
        splat, yaw, x = cv2.GaussianBlur(wall, (0, 0), 4), (0.0, 0.5)[index % 2], (12.0, 10.0)[index % 2]
        grey = np.clip(facade_view(wall, x, yaw) + rng.normal(0, 3, (480, 640)), 0, 255).astype(np.uint8)
        pixels = np.repeat(grey[..., None], 3, axis=2)
        for spoiler, spoil in spoilers.items():
            photo = WorkingPhoto.of(Photo(spoil(pixels, rng, "facade")), FACADE_LENS, 640)
            for camera, moved in (("right", 0.0), ("one window off", WINDOW_M)):
                render = facade_view(splat, x + moved, yaw).astype(np.uint8)
                yield row("facade", index // 2, spoiler, camera, compare(photo, render, render > 0), 640)


def verdict(one: Row) -> str:
    """What the rules of today make of the regions, were everything else beyond doubt."""
    region = Region(**one.region)
    return judge(
        PoseQuality(
            of="refined", pose=Pose(), photo_long_side_px=one.long_side, median_depth=1.0, corners=one.corners,
            agreement=one.agreement, offset_px_of_photo=1.0, similarity=1.0, views_used=7, inliers=1000, coverage=1.0,
            rms_px_of_photo=0.5, disagreement_pct=0.0, disagreement_deg=0.0, translation_std_pct=0.0, rotation_std_deg=0.0,
            region_corners=region.corners, region_share=region.share, region_expected=region.expected, region_area=region.area,
            region_offset_px_of_photo=one.photo_px * region.offset_px, unrivalled=region.unrivalled,
        )
    )[0]  # fmt: skip


def table(rows: list[Row]) -> str:
    out = []
    for title, part in (("set on", 0), ("reported on", 1)):
        chosen = [r for r in rows if r.photo % 2 == part]
        out += [
            f"\n{title}\n",
            "| scans | photo | camera | comparisons | trusted | check | failed | agreement | corners |",
            "|---" * 9 + "|",
        ]
        groups: dict[tuple[str, str, str], list[Row]] = {}
        for r in chosen:
            where = "facade" if r.scene == "facade" else "scans"
            photo = r.spoiler if r.camera in ("right", "one window off") else "all of these"
            groups.setdefault((where, photo, r.camera), []).append(r)
        for (where, photo, camera), members in sorted(groups.items(), key=lambda g: (g[0][0] != "scans", g[0][2] != "right")):
            out.append(_line(where, photo, camera, members))
    return "\n".join(out)


def _line(where: str, photo: str, camera: str, rows: list[Row]) -> str:
    verdicts = [verdict(r) for r in rows]
    counts = " | ".join(str(verdicts.count(v)) for v in ("trusted", "check", "failed"))
    agreement, corners = np.median([(r.agreement, r.region["corners"]) for r in rows], axis=0)
    return f"| {where} | {photo} | {camera} | {len(rows)} | {counts} | {100 * agreement:.0f} % | {corners:.0f} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["fox", "monstree", "room"])
    parser.add_argument("--out", type=Path, help="write every comparison here")
    parser.add_argument("--judge-again", action="store_true", help="no new comparisons: today's rules on those in --out")
    args = parser.parse_args()
    if args.judge_again:
        print(table([Row(**data) for data in json.loads(args.out.read_text())]))
        return 0
    if not SCENES.is_dir():
        print(f"no scans at {SCENES}: nothing to measure", file=sys.stderr)
        return 2
    cv2.setNumThreads(1)
    rows: list[Row] = list(facade_rows())
    for name in args.scenes:
        for one in scan_rows(Scan.load(name)):
            rows.append(one)
            if args.out and len(rows) % 55 == 0:
                args.out.write_text(json.dumps([asdict(r) for r in rows]))
        print(f"{name}: {len(rows)} comparisons", file=sys.stderr, flush=True)
    data: list[dict[str, Any]] = [asdict(r) for r in rows]
    if args.out:
        args.out.write_text(json.dumps(data))
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
