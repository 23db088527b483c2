"""Blender's gpu module as the renderer: its pictures against the processor's and another program's, and its time.

    .venv/bin/python benchmarks/render_gpu.py [--scenes fox monstree room] [--share 1.0] [--frames N]
    .venv/bin/python benchmarks/render_gpu.py --refine [--scenes ...] [--frames N]

The second refines photos from 5 % and 4 degrees off with views of the processor and of the card, and says how far apart the two
cameras are, beside the deviations that the first one states. Runs in any Python that has bpy 5.2 or newer, which make a GPU
context in background mode. --share: of the pictures' size; --frames: the first so many of each scene. Needs the scans in
../shared/scenes (see the README). "off" is the share of pixels whose colour or alpha is more than 1e-4, or whose depth more
than 0.1 %, from those of `core.render.Renderer`.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
import types
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import bpy
import gpu
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT.parent / "shared" / "scenes"


def extension(name: str) -> Any:
    """A module of the extension, under a name of our own: all its imports are relative, as Blender needs them."""
    if "gssmc" not in sys.modules:
        package = types.ModuleType("gssmc")
        package.__path__ = [str(ROOT)]
        sys.modules["gssmc"] = package
    return importlib.import_module(f"gssmc.{name}")


class Card:
    """One scan on the card; work is done in this thread, step by step, as the window's main thread does it."""

    def __init__(self, scene: Any, near: float) -> None:
        self._draw, self._tables = extension("gssmc_addon.render_gpu.draw"), extension("gssmc_addon.render_gpu.tables")
        self._scan, self._near = self._tables.scan_texels(scene), near
        self._there = self._draw.GpuScan(extension("gssmc_addon.render_gpu.choice").shaders(), self._scan)
        self.worst_s = 0.0  # the longest step so far, in which a window would not answer
        self._run(self._there.send(self._scan))

    def render(self, k: Any, pose: Any) -> tuple[Any, float, float]:
        """The view, and the seconds of its numpy part and of its drawing."""
        begin = time.perf_counter()
        request = self._draw.ViewRequest(k, pose, self._tables.seen_points(self._scan, k, pose, self._near))
        middle = time.perf_counter()
        view = self._run(self._there.draw(request))
        return view, middle - begin, time.perf_counter() - middle

    def _run(self, steps: Any) -> Any:
        while True:
            begin = time.perf_counter()
            try:
                next(steps)
            except StopIteration as end:
                return end.value
            self.worst_s = max(self.worst_s, time.perf_counter() - begin)


def off(view: Any, right: Any) -> float:
    """The share of pixels that differ."""
    differ = (np.abs(view.color - right.color).max(axis=2) > 1e-4) | (np.abs(view.alpha - right.alpha) > 1e-4)
    return float((differ | ((right.alpha > 0.1) & (np.abs(view.depth - right.depth) > 1e-3 * right.depth))).mean())


def run_scene(name: str, share: float, frames: int) -> None:
    render, camera = extension("core.render"), extension("core.geometry.camera")
    scene = extension("core.splats").read_splats(SCENES / name / "scene.ply")
    settings = render.RenderSettings(threads=1)
    card, processor = Card(scene, settings.near), render.Renderer(scene, settings)
    for frame in json.loads((SCENES / name / "reference.json").read_text())["frames"][: frames or None]:
        whole = camera.Intrinsics(*(frame[key] for key in ("width", "height", "fx", "fy", "cx", "cy")))
        k = whole if share == 1 else whole.resized(round(share * whole.width), round(share * whole.height))
        pose = camera.Pose(frame["R"], frame["t"])
        card.render(k, pose)  # shaders are compiled in the first
        card.worst_s = 0.0
        view, numpy_s, card_s = card.render(k, pose)
        begin = time.perf_counter()
        right = processor.render(k, pose)
        cells = [name, frame["file"], f"{k.width} x {k.height}", f"{1000 * numpy_s:.0f}", f"{1000 * card_s:.0f}"]
        cells += [f"{1000 * card.worst_s:.0f}", f"{1000 * (time.perf_counter() - begin):.0f}", f"{off(view, right):.1e}"]
        cells += [f"{np.abs(view.color - right.color).max():.1e}"]
        cells += ["", ""] if share != 1 else against_reference(view, name, frame["file"])
        print(f"| {' | '.join(cells)} |", flush=True)


def against_reference(view: Any, name: str, file: str) -> list[str]:
    """Colour and depth against the other program's: shares within 2/255 and within 0.1 %."""
    with np.load(SCENES / name / "reference" / f"{Path(file).stem}.npz") as wanted:
        solid = wanted["alpha"] > 0.5
        color = (np.abs(view.color - wanted["color"]).max(axis=2) <= 2 / 255).mean()
        depth = (np.abs(view.depth - wanted["depth"])[solid] <= 1e-3 * wanted["depth"][solid]).mean()
    return [f"{color:.5f}", f"{depth:.5f}"]


def refine_scene(name: str, frames: int) -> None:
    """Rows of the held-out photos' refinements."""
    core = {key: extension(f"core.{key}") for key in ("cameras.files", "geometry.camera", "photos.photo", "pose.refine")}
    render, settings = extension("core.render"), extension("core.pose.settings").RefineSettings(threads=2)
    scene = extension("core.splats").read_splats(SCENES / name / "scene.ply")
    depth = json.loads((SCENES / name / "queries.json").read_text())["median_depth"]
    drawing, perturb = render.RenderSettings(threads=2), extension("core.synthetic").perturb_camera
    for index, truth in enumerate(core["cameras.files"].read_cameras(SCENES / name / "queries.json")[: frames or None]):
        photo = core["photos.photo"].read_photo(SCENES / name / truth.file)
        work = (photo, perturb(truth, 0.05 * depth, 4.0, index), settings)
        with render.ProcessRenderer(scene, drawing) as renderer:
            processor = core["pose.refine"].refine(renderer, *work)
        card, fault = served(lambda renderer, w=work: core["pose.refine"].refine(renderer, *w), scene, drawing)
        distance, degrees = core["geometry.camera"].pose_error(card.camera.pose, processor.camera.pose)
        quality = processor.quality
        stated = f"{quality.translation_std_pct:.4f} / {quality.rotation_std_deg:.4f}" if quality else "none"
        cells = [name, Path(truth.file).stem, processor.verdict, card.verdict, f"{100 * distance / depth:.4f} / {degrees:.4f}"]
        print(f"| {' | '.join([*cells, stated, fault or 'none'])} |", flush=True)


def served(refine: Callable[[Any], Any], scene: Any, settings: Any) -> tuple[Any, str]:
    """What a refinement in a thread finds with views of the card, which this thread draws for it; and what failed."""
    executor, render = extension("gssmc_addon.render_gpu.executor").executor, extension("core.render")
    renderer = extension("gssmc_addon.render_gpu.renderer").GpuRenderer(
        scene, settings, lambda: render.ProcessRenderer(scene, settings), executor.hold()
    )
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(refine, renderer)
        while not future.done():
            if not executor.serve():
                time.sleep(0.002)
    renderer.close()
    return future.result(), renderer.fault


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["fox", "monstree", "room"])
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--frames", type=int, default=0, help="the first so many of each scene (all)")
    parser.add_argument("--refine", action="store_true", help="refinements instead of views")
    args = parser.parse_args()
    gpu.init()
    print(f"Blender {bpy.app.version_string}, {gpu.platform.renderer_get()}, {gpu.platform.backend_type_get()}")
    if args.refine:
        heads = ["scan", "photo", "processor", "card", "apart, % of depth / deg", "stated deviations, the same", "fault"]
        print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
        for name in args.scenes:
            refine_scene(name, args.frames)
        return
    heads = ["scan", "view", "pixels", "numpy, ms", "card, ms", "longest step, ms", "one thread, ms", "off", "colour off"]
    heads += ["colour as another's", "depth as another's"]
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name in args.scenes:
        run_scene(name, args.share, args.frames)


if __name__ == "__main__":
    main()
