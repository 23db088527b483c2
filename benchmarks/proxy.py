"""Proxy meshes: how long they take, and how far they lie from the scan and from exact truth.

    .venv/bin/python benchmarks/proxy.py [--only room fox] [--faces 100000] [--threads 2] [--long-side 720] [--smooth 4]

"room" is the procedural room, made from six cameras, or from one, and seen from six others, or from that one; its truth is
exact, but for the bush, which is left out. "fox" is the scan in ../shared/scenes/fox, made from ten of the cameras that it was
trained on and seen from the ten that it was not; what the splat's own render shows there is the truth.

seen: the share of the truth's pixels in which the proxy is seen. along rays: median, and three quarters of the pixels, of the
difference in depth, of the depth. distance: the same of the nearest place of the mesh to each point of the truth. edges: pixels
from each jump of 6 % in the truth's depth to the nearest one in the proxy's, median, and the share within 2 px. CPU: seconds of
all threads together, which does not change with what else the machine does.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "core" / "support")]

from mesh_depth import mesh_depth

from core.cameras import starts
from core.geometry.camera import Camera
from core.geometry.conventions import pixel_centres
from core.proxy import ProxyMesh, ProxySettings, make_proxy
from core.render import Renderer, RenderSettings
from core.splats import GaussianScene, read_splats
from core.synthetic import make_scene, sample_cameras
from core.synthetic.truth import exact_depth

FOX = ROOT.parent / "shared" / "scenes" / "fox"
JUMP, EDGE_PX = 0.06, 2.0
SAMPLES = 1_500_000  # of the mesh, for distances
EVERY = 6  # rows and columns of the truth's pixels from which distances are taken
UNSURE_PX = 4  # around pixels without truth no edge is looked at
COLUMNS = ("proxy", "views", "triangles", "s", "CPU s", "seen", "along rays", "distance", "edges")


@dataclass(frozen=True)
class Place:
    """What a proxy is made of and held to: `truth` gives the depth (H, W) that a camera should see, NaN where nobody knows."""

    name: str
    scene: GaussianScene
    cameras: Sequence[Camera]
    seen_from: Sequence[Camera]
    truth: Callable[[Camera], np.ndarray]


def room(count: int) -> Place:
    cameras = [pinhole(camera, 640) for camera in sample_cameras(12)]
    chosen, others = (cameras[::2], cameras[1::2]) if count > 1 else (cameras[2:3], cameras[2:3])
    return Place("room", make_scene(0), chosen, others, exact_depth)


def fox() -> Place:
    scene = read_splats(FOX / "scene.ply")
    renderer = Renderer(scene, RenderSettings.for_scene(scene))

    def truth(camera: Camera) -> np.ndarray:
        view = renderer.render(camera.intrinsics, camera.pose)
        return np.where(view.alpha >= 0.5, view.depth, np.nan)

    trained, held = ([start.known_camera() for start in starts(FOX / f"{n}.json").placed] for n in ("train", "queries"))
    return Place("fox", scene, trained[::4], [pinhole(camera, 640) for camera in held], truth)


def pinhole(camera: Camera, long_side: int) -> Camera:
    return replace(camera, intrinsics=camera.intrinsics.pinhole().with_long_side(long_side))


def row(place: Place, settings: ProxySettings) -> str:
    began, cpu = time.perf_counter(), time.process_time()
    mesh = make_proxy(place.scene, place.cameras, settings)
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    tree = cKDTree(samples(mesh, place.cameras))
    seen, rays, far, edges = zip(
        *(compared(mesh, tree, camera, place.truth(camera)) for camera in place.seen_from), strict=True
    )
    off = np.concatenate(edges)
    told = f"{np.median(off):.1f} px, {100 * np.mean(off <= EDGE_PX):.0f} %" if place.name == "room" else "-"
    times = f"{seconds:.1f}", f"{cpu:.1f}"
    numbers = f"{100 * np.mean(seen):.1f} %", spread(np.concatenate(rays)), spread(np.concatenate(far)), told
    return line(place.name, str(len(place.cameras)), str(len(mesh.faces)), *times, *numbers)


def compared(mesh: ProxyMesh, tree: cKDTree, camera: Camera, truth: np.ndarray) -> tuple[float, np.ndarray, ...]:
    """The share of pixels in which the proxy is seen, relative differences along rays, relative distances, pixels of edges."""
    depth = mesh_depth(mesh.vertices, mesh.faces, camera)
    known = np.isfinite(truth)
    both = known & (depth > 0)
    k = camera.intrinsics
    x, y = np.meshgrid((pixel_centres(k.width) - k.cx) / k.fx, (pixel_centres(k.height) - k.cy) / k.fy)
    local = (np.dstack([x, y, np.ones_like(x)]) * truth[..., None])[::EVERY, ::EVERY][known[::EVERY, ::EVERY]]
    distance, _ = tree.query(camera.pose.inverse().transform(local))
    sure = cv2.dilate((~known).astype(np.uint8), np.ones((2 * UNSURE_PX + 1,) * 2, np.uint8)) == 0
    to_edge = distance_transform_edt(~jumps(depth, depth > 0))
    off = to_edge[jumps(truth, known) & sure]
    return both.sum() / known.sum(), (np.abs(depth - truth) / truth)[both], distance / local[:, 2], off


def jumps(depth: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Pixels (H, W) whose depth differs by JUMP from a neighbour's; unknown ones have the depth of the nearest known one."""
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    depth = depth[tuple(nearest)]
    out = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        a, b = np.moveaxis(depth, axis, 0)[1:], np.moveaxis(depth, axis, 0)[:-1]
        np.moveaxis(out, axis, 0)[1:] |= np.abs(a - b) > JUMP * np.minimum(a, b)
    return out


def samples(mesh: ProxyMesh, cameras: Sequence[Camera]) -> np.ndarray:
    """Places on the mesh, as dense everywhere as the cameras see it."""
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    eye = np.mean([camera.pose.centre for camera in cameras], axis=0)
    weight = area / np.maximum(((corners.mean(axis=1) - eye) ** 2).sum(axis=1), 1e-9)
    rng = np.random.default_rng(0)
    which, share = rng.choice(len(area), SAMPLES, p=weight / weight.sum()), rng.random((SAMPLES, 2))
    share = np.where(share.sum(axis=1, keepdims=True) > 1, 1 - share, share)
    a, b, c = (corners[which, k] for k in range(3))
    return a + share[:, :1] * (b - a) + share[:, 1:] * (c - a)


def spread(values: np.ndarray) -> str:
    middle, most = np.percentile(100 * values, (50, 75))
    return f"{middle:.2f}, {most:.2f} %"


def line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", choices=("room", "fox"), default=("room", "fox"))
    for flag, default in (("--faces", 100_000), ("--threads", 2), ("--long-side", 720)):
        parser.add_argument(flag, type=int, default=default)
    parser.add_argument("--smooth", type=float, default=ProxySettings.smooth_px)
    args = parser.parse_args()
    settings = ProxySettings(faces=args.faces, long_side_px=args.long_side, smooth_px=args.smooth, threads=args.threads)
    print(line(*COLUMNS), line(*["---"] * len(COLUMNS)), sep="\n")
    if "room" in args.only:
        for count in (6, 1):
            print(row(room(count), settings), flush=True)
    if "fox" in args.only and FOX.exists():
        print(row(fox(), settings), flush=True)


if __name__ == "__main__":
    main()
