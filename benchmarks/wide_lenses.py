"""Photos of wide lenses on the real scans: each held-out photo is bent into a fisheye's, refined from 5 % and 4 degrees off.

    .venv/bin/python benchmarks/wide_lenses.py [--scenes fox monstree] [--photos N] [--degrees 150]

The fisheye (OPENCV_FISHEYE with all four coefficients) spans --degrees across the longer side of its picture and has the
photo's own resolution in its middle; what the photo does not show of it is transparent. OpenCV's fisheye model bends it, not
the project's. Beside it stands the unbent photo itself from the same start. Errors are per cent of the scan's median depth and
degrees.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.real_scenes import SCENES, STARTS, Scan, start_camera
from core.batch.refine_one import refine_photo
from core.geometry.camera import Camera, Intrinsics, pose_error
from core.geometry.pinhole_cut import WideCamera
from core.geometry.wide_lens import WideLens
from core.photos.photo import Photo, read_photo
from core.pose.settings import RefineSettings
from core.render import ProcessRenderer, RenderSettings

COEFFICIENTS = (0.02, -0.008, 0.003, -0.001)


@dataclass(frozen=True)
class Home:
    """Per cent of the depth, degrees, and the verdict of one refinement."""

    distance: float
    degrees: float
    verdict: str


def fisheye_of(photo: Photo, k: Intrinsics, degrees: float) -> tuple[Photo, WideLens]:
    """The photo as a fisheye of that angle across its longer side would have taken it, and that lens."""
    half = np.radians(degrees / 2)
    reach = half * (1 + sum(c * half ** (2 * i + 2) for i, c in enumerate(COEFFICIENTS)))
    fx, fy = k.fx, k.fy * 1.002
    width, height = (round(2 * reach * fx * side / max(k.width, k.height)) for side in (k.width, k.height))
    K = np.array([[fx, 0, width / 2 + 3.3], [0, fy, height / 2 - 2.1], [0, 0, 1]])
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)[:, None]
    rays = cv2.fisheye.undistortPoints(pixels, K, np.array(COEFFICIENTS)).reshape(-1, 2)
    far = np.abs(rays).max(axis=1) > 2  # beyond the photo, and where OpenCV's inversion ends
    at = k.project(np.column_stack([np.where(far[:, None], 0, rays), np.ones(len(rays))])) - 0.5
    at[far] = -1e6
    maps = at.reshape(height, width, 2).astype(np.float32)
    bent = cv2.remap(photo.pixels, maps[..., 0], maps[..., 1], cv2.INTER_LANCZOS4)
    inside = ((maps >= 0) & (maps <= (k.width - 1, k.height - 1))).all(axis=2)
    lens = WideLens(
        *("OPENCV_FISHEYE", width, height, fx, fy, K[0, 2], K[1, 2]),
        tuple(zip(("k1", "k2", "k3", "k4"), COEFFICIENTS, strict=True)),
    )
    return Photo(np.where(inside[..., None], bent, 0), photo.file, mask=inside), lens


def run_scene(name: str, count: int, degrees: float) -> list[tuple[str, Home, Home]]:
    """Of each photo its name, how the unbent one comes home, and how its fisheye does."""
    scan, rows, settings = Scan.load(name), [], RefineSettings(threads=1)
    with ProcessRenderer(scan.scene, RenderSettings(threads=1)) as renderer:
        for index, truth in enumerate(scan.cameras[:count]):
            photo = read_photo(SCENES / name / truth.file)
            start = start_camera(truth, scan.depth, *STARTS["near"], seed=index)
            bent, lens = fisheye_of(photo, truth.intrinsics, degrees)
            homes = []
            wide = WideCamera.of(lens, start.pose, start.file)
            for picture, camera in ((photo, start), (bent, wide)):
                report = refine_photo(renderer, picture, camera, settings)
                homes.append(_home(report.camera, truth, scan.depth, report.verdict))
            rows.append((Path(truth.file).stem, *homes))
    return rows


def _home(camera: Camera, truth: Camera, depth: float, verdict: str) -> Home:
    distance, degrees = pose_error(camera.pose, truth.pose)
    return Home(100 * distance / depth, degrees, verdict)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["fox"])
    parser.add_argument("--photos", type=int, default=1000)
    parser.add_argument("--degrees", type=float, default=150)
    args = parser.parse_args()
    print("| scan | photo | as it is: % depth / deg | as a fisheye: % depth / deg | verdicts |\n|---|---|---|---|---|")
    for name in args.scenes:
        for photo, plain, wide in run_scene(name, args.photos, args.degrees):
            errors = " | ".join(f"{one.distance:.3f} / {one.degrees:.3f}" for one in (plain, wide))
            print(f"| {name} | {photo} | {errors} | {plain.verdict}, {wide.verdict} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
