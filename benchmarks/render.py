"""Speed and memory of the rasteriser, beside its slow twin and a native C++ renderer in the same run.

    .venv/bin/python benchmarks/render.py [--quick] [--repeats N] [--sizes 10000 100000 1000000 5000000]
    .venv/bin/python benchmarks/render.py --stages | --side-by-side [--repeats N]

Every line is a process of its own, so that the peak memory is that of the line (scene included). ms: median of the repeats
after a warm-up frame; the native renderer (../shared/tools/refsplat, needs g++) draws the same scene and camera right after.
The twin is timed once, on the smallest case. The scans need ../shared/scenes; what is absent is left out and said.
--side-by-side: eight views of the fox at 360x640, as a refinement draws them, one after the other, in two threads of this
process and in two processes, by turns.
--stages: fox at 360x640 on one thread and two, frames taking turns, their ratio and the processor time of each stage.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import core.render.renderer as stages_of
from core.geometry.camera import Camera, Intrinsics, Pose
from core.render import ProcessRenderer, Renderer, RenderSettings, render_reference
from core.splats import read_splats
from core.splats.ply.reader import write_ply
from core.splats.scene import GaussianScene

SHARED = ROOT.parent / "shared"
SIZES = (10_000, 100_000, 1_000_000, 5_000_000)
RESOLUTIONS = ((320, 240), (640, 480), (1280, 960))
NATIVE_MAX = 1_000_000  # a 5M scene would be a 1.2 GB file for the native renderer
TWIN_MAX = 10_000
BLACK = "-"
STAGES = ("project_part", "depth_order", "colors", "bin_band", "join_bands", "plan_batches", "blend_tiles")


def synthetic(n: int, behind: int = 0) -> GaussianScene:
    """n Gaussians (SH degree 3) on wavy sheets that fill a 60 degree view, sized to close them; `behind` more out of view."""
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-1, 1, (2, n)).astype(np.float32)
    z = 3 + 2 * rng.integers(0, 3, n) + np.sin(5 * u) * np.cos(4 * v)
    means = np.stack([0.65 * u * z, 0.5 * v * z, z], axis=1)
    spread = 6.0 / np.sqrt(n) * np.exp(rng.normal(0, 0.5, (n, 3)))
    spread[:, 2] *= 0.2
    if behind:
        means = np.concatenate([means, rng.normal(size=(behind, 3)) - (0, 0, 50)])
        spread = np.concatenate([spread, np.full((behind, 3), 0.01)])
    total = n + behind
    rotations = rng.normal(size=(total, 4))
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    sh = rng.standard_normal((total, 16, 3), np.float32) * np.float32(0.1)
    parts = (means, spread, rotations, rng.uniform(0.05, 1, total))
    return GaussianScene(*(np.ascontiguousarray(a, np.float32) for a in parts), sh)


def load(case: dict[str, object]) -> tuple[GaussianScene, Intrinsics, Pose]:
    width, height = case["size"]
    if "n" in case:
        k = Intrinsics(width, height, 0.87 * width, 0.87 * width, width / 2, height / 2)
        return synthetic(case["n"], case.get("behind", 0)), k, Pose()
    folder = SHARED / "scenes" / case["scan"]
    frame = json.loads((folder / "reference.json").read_text())["frames"][case["frame"]]
    k = Intrinsics(*(frame[key] for key in ("width", "height", "fx", "fy", "cx", "cy")))
    return read_splats(folder / "scene.ply"), k.resized(width, height), Pose(frame["R"], frame["t"])


def median_ms(renderer: Renderer, k: Intrinsics, pose: Pose, repeats: int) -> float:
    renderer.render(k, pose)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        renderer.render(k, pose)
        times.append(time.perf_counter() - start)
    return float(np.median(times) * 1e3)


def native_ms(binary: Path, scene: GaussianScene, view: Camera, threads: int, repeats: int) -> float:
    k, pose = view.intrinsics, view.pose
    camera = {"file": "a.png", "width": k.width, "height": k.height, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy}
    camera |= {"R": pose.R.tolist(), "t": pose.t.tolist()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_ply(folder / "scene.ply", scene)
        (folder / "cameras.json").write_text(json.dumps({"frames": [camera]}))
        options = f"--threads {threads} --repeats {repeats} --no-output 1 --rect-sigma 0".split()
        command = [binary, folder / "scene.ply", folder / "cameras.json", folder, *options]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = re.search(r"median ([\d.]+) ms per frame", said)
    if not found:
        raise RuntimeError(f"The native renderer printed no time: {said[-200:]!r}")
    return float(found.group(1))


def run_case(case: dict[str, object], binary: Path | None, repeats: int) -> dict[str, float | None]:
    scene, k, pose = load(case)
    renderer = Renderer(scene, RenderSettings(threads=case["threads"]))
    out: dict[str, float | None] = {"ms": median_ms(renderer, k, pose, repeats), "native": None, "twin": None}
    out["peak_mib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if binary and len(scene) <= NATIVE_MAX:
        out["native"] = native_ms(binary, scene, Camera(k, pose), case["threads"], repeats)
    if case.get("twin"):
        start = time.perf_counter()
        render_reference(scene, k, pose)
        out["twin"] = (time.perf_counter() - start) * 1e3
    return out


def cases(sizes: list[int], quick: bool) -> list[dict[str, object]]:
    resolutions = RESOLUTIONS[1:2] if quick else RESOLUTIONS
    out: list[dict[str, object]] = []
    for n in sizes:
        out += [{"name": f"synthetic {n:,}", "n": n, "size": r, "threads": t} for r in resolutions for t in (1, 2)]
    for case in out:
        case["twin"] = case["n"] <= TWIN_MAX and case["size"] == resolutions[0] and case["threads"] == 1
    for scan, small in (("fox", (360, 640)), ("monstree", (360, 480))):
        if (SHARED / "scenes" / scan / "scene.ply").exists():
            frames = range(1) if quick else range(3)
            out += [
                {"name": f"{scan} view {f}", "scan": scan, "frame": f, "size": small, "threads": t}
                for f in frames
                for t in (1, 2)
            ]
        else:
            print(f"{scan}: left out, ../shared/scenes/{scan} is not here")
    return out


def in_child(case: dict[str, object], binary: Path | None, repeats: int) -> dict[str, float | None]:
    command = [sys.executable, __file__, "--case", json.dumps(case), "--repeats", str(repeats)]
    command += ["--native", str(binary)] if binary else []
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def build_native(folder: Path) -> Path | None:
    source = SHARED / "tools" / "refsplat"
    if not source.exists() or not shutil.which("g++") or not shutil.which("make"):
        print("native renderer: left out, ../shared/tools/refsplat, g++ or make is not here")
        return None
    shutil.copytree(source, folder / "refsplat")
    subprocess.run(["make", "-C", folder / "refsplat"], check=True, capture_output=True)
    return folder / "refsplat" / "refsplat-render"


def print_row(case: dict[str, object], r: dict[str, float | None]) -> None:
    ratio = f"{r['ms'] / r['native']:.2f}" if r["native"] else BLACK
    native = f"{r['native']:.0f}" if r["native"] else BLACK
    twin = f"{r['twin'] / r['ms']:.0f}x" if r["twin"] else BLACK
    size = "x".join(map(str, case["size"]))
    print(
        f"| {case['name']} | {size} | {case['threads']} | {r['ms']:.0f} | {r['peak_mib']:.0f} | {native} | {ratio} | {twin} |",
        flush=True,
    )


def print_stages(repeats: int) -> None:
    """Frames of fox views 0 to 2, and where their processor time goes; both medians, milliseconds."""
    spent = dict.fromkeys((*STAGES, "store"), 0.0)

    def timed(owner: object, name: str, stage: str) -> None:
        function = getattr(owner, name)

        def call(*args: object) -> object:
            start = time.thread_time()
            try:
                return function(*args)
            finally:
                spent[stage] += (time.thread_time() - start) * 1e3

        setattr(owner, name, call)

    for stage in STAGES:
        timed(stages_of, stage, stage)
    timed(stages_of._Stripe, "_store", "store")
    print("| view | threads | ms | gain | CPU ms | " + " | ".join(spent) + " |\n" + "|---" * (5 + len(spent)) + "|")
    for view in range(3):
        scene, k, pose = load({"scan": "fox", "frame": view, "size": (360, 640)})
        renderers = [Renderer(scene, RenderSettings(threads=t)) for t in (1, 2)]
        rows = np.zeros((repeats + 1, 2, 2 + len(spent)))
        for frame in rows:  # the first is warm-up
            for row, renderer in zip(frame, renderers, strict=True):
                spent.update(dict.fromkeys(spent, 0.0))
                wall, cpu = time.perf_counter(), time.process_time()
                renderer.render(k, pose)
                row[:] = (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3, *spent.values()
        for threads, (ms, *cpu) in zip((1, 2), np.median(rows[1:], axis=0), strict=True):
            gain = np.median(rows[1:, 0, 0]) / ms
            print(f"| {view} | {threads} | {ms:.1f} | {gain:.2f} | " + " | ".join(f"{c:.1f}" for c in cpu) + " |", flush=True)


def print_side_by_side(repeats: int, count: int = 2) -> None:
    """Seconds for eight views: a median of the repeats after a warm-up, and the gain over one after the other."""
    loaded = [load({"scan": "fox", "frame": view % 3, "size": (360, 640)}) for view in range(8)]
    scene, views = loaded[0][0], [(k, pose) for _, k, pose in loaded]
    one = Renderer(scene, RenderSettings(threads=1))
    with ProcessRenderer(scene, RenderSettings(threads=count)) as several, ThreadPoolExecutor(count) as pool:
        ways: dict[str, Callable[[], object]] = {
            "one after the other": lambda: [one.render(*view) for view in views],
            f"{count} threads": lambda: list(pool.map(lambda view: one.render(*view), views)),
            f"{count} processes": lambda: list(pool.map(lambda view: several.render(*view), views)),
        }
        time.sleep(3)  # until the other process is there
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(repeats + 1):
            for name, draw in ways.items():
                start = time.perf_counter()
                draw()
                seconds[name].append(time.perf_counter() - start)
    medians = {name: float(np.median(s[1:])) for name, s in seconds.items()}
    print("| 8 views | s | gain |\n|---|---|---|")
    for name, s in medians.items():
        print(f"| {name} | {s:.2f} | {medians['one after the other'] / s:.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one resolution, one view per scan")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--sizes", type=int, nargs="*", default=list(SIZES))
    parser.add_argument("--stages", action="store_true", help="where the time of a frame of the fox goes")
    parser.add_argument("--side-by-side", action="store_true", help="views of the fox in threads and in processes")
    parser.add_argument("--case", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--native", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.case:
        print(json.dumps(run_case(args.case, args.native, args.repeats)))
        return
    if args.side_by_side:
        print_side_by_side(args.repeats)
        return
    if args.stages:
        print_stages(args.repeats)
        return
    print(f"{os.cpu_count()} cores; command: {' '.join(['python', *sys.argv])}")
    with tempfile.TemporaryDirectory() as name:
        binary = build_native(Path(name))
        print("| scene | pixels | threads | ms | peak MiB | native ms | x native | twin slower by |")
        print("|---|---|---|---|---|---|---|---|")
        for case in cases(args.sizes, args.quick):
            print_row(case, in_child(case, binary, args.repeats))
    print(f"\nA Gaussian outside the view costs {culled_ns(args.repeats):.0f} ns.")


def culled_ns(repeats: int, behind: int = 1_000_000) -> float:
    """What one Gaussian outside the view adds to a frame, one thread; frames with and without them take turns."""
    case = {"n": 10_000, "size": (320, 240), "threads": 1}
    _, k, pose = load(case)
    one = RenderSettings(threads=1)
    renderers = [Renderer(load(case | {"behind": b})[0], one) for b in (0, behind)]
    plain, more = np.min([[median_ms(r, k, pose, repeats) for r in renderers] for _ in range(3)], axis=0)
    return float(more - plain) * 1e6 / behind


if __name__ == "__main__":
    main()
