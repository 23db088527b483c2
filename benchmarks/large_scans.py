"""Large scans out of small ones, and what making a map of them takes, each in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from core.geometry.quaternion import rotations_of
from core.locate import MapSettings, build_map
from core.splats import read_splats
from core.splats.ply.reader import write_ply
from core.splats.scene import GaussianScene

PART_SPREAD = 0.8  # of a Gaussian's deviations: where its parts lie
FLOATERS = 20_000
BLOCK = 1 << 16  # Gaussians that are split at once


def scene_of(*arrays: np.ndarray) -> GaussianScene:
    return GaussianScene(*(np.ascontiguousarray(array, np.float32) for array in arrays))


def split(scene: GaussianScene, parts: int, seed: int = 0) -> GaussianScene:
    """Each Gaussian as `parts` smaller ones, that lie where it lay and cover as much: a scan trained to finer detail."""
    rng, done = np.random.default_rng(seed), []
    for begin in range(0, len(scene), BLOCK):
        part = slice(begin, begin + BLOCK)
        scales = np.repeat(scene.scales[part], parts, axis=0)
        offset = PART_SPREAD * rng.normal(size=scales.shape).astype(np.float32) * scales
        R = np.repeat(rotations_of(scene.rotations[part]), parts, axis=0)
        means = np.repeat(scene.means[part], parts, axis=0) + np.einsum("nij,nj->ni", R, offset)
        done.append((means, scales / np.sqrt(parts)))
    means, scales = (np.concatenate(column) for column in zip(*done, strict=True))
    return scene_of(means, scales, *(np.repeat(a, parts, axis=0) for a in (scene.rotations, scene.opacities, scene.sh)))


def copies(scene: GaussianScene, count: int) -> GaussianScene:
    """The scan `count` times, side by side on a square."""
    low, high = np.percentile(scene.means, (5, 95), axis=0)
    pitch, side = 1.6 * (high - low).max(), int(np.ceil(np.sqrt(count)))
    offsets = [np.array([k % side, 0, k // side]) * pitch for k in range(count)]
    means = np.concatenate([scene.means + offset for offset in offsets])
    rest = (scene.scales, scene.rotations, scene.opacities, scene.sh)
    return scene_of(means, *(np.concatenate([a] * count) for a in rest))


@dataclass(frozen=True, eq=False)
class Town:
    """Scans of several places in one: `offset` of each place, to be added to its coordinates after `scale`."""

    scene: GaussianScene
    offset: list[np.ndarray]
    scale: list[float]


def town(scenes: Sequence[GaussianScene], sizes: Sequence[float], seed: int = 0) -> Town:
    """The places in a row, each scaled so that its `sizes` entry (its median depth) is 1, with FLOATERS floaters among them and
    a shell of large Gaussians around all.
    """
    rng, offsets, parts = np.random.default_rng(seed), [], []
    keep = min(scene.sh.shape[1] for scene in scenes)
    for k, (scene, size) in enumerate(zip(scenes, sizes, strict=True)):
        offset = np.array([12.0 * k, 0.0, 0.0]) - np.median(scene.means, axis=0) / size
        offsets.append(offset)
        parts.append((scene.means / size + offset, scene.scales / size, scene.rotations, scene.opacities, scene.sh[:, :keep]))
    low, high = np.array([-8.0, -6, -8]), np.array([12.0 * len(scenes), 6, 8])
    shell = rng.normal(size=(2000, 3))
    shell = (low + high) / 2 + 60 * shell / np.linalg.norm(shell, axis=1, keepdims=True)
    for means, size, opacity in ((rng.uniform(low, high, (FLOATERS, 3)), 0.03, 0.3), (shell, 4.0, 0.9)):
        n = len(means)
        turn = np.tile([1.0, 0, 0, 0], (n, 1))
        parts.append((means, np.full((n, 3), size), turn, np.full(n, opacity), 0.5 * rng.normal(size=(n, keep, 3))))
    return Town(scene_of(*(np.concatenate(column) for column in zip(*parts, strict=True))), offsets, [1 / s for s in sizes])


def _peak() -> int:
    """Bytes, the most that this process has held since `_reset`."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024
    return 0


def _measured(path: Path, views: int) -> tuple[int, int, float, float, float, int]:
    scene = read_splats(path)
    Path("/proc/self/clear_refs").write_text("5")
    before, began, first, step = _peak(), time.process_time(), float("nan"), None
    for step in build_map(scene, MapSettings(views=views), key="benchmark"):
        if len(step.map) == 10 and np.isnan(first):
            first = time.process_time() - began
    assert step is not None
    return len(scene), len(step.map), first, time.process_time() - began, (_peak() - before) / 1e6, _peak()


def scale_rows(scenes: dict[str, Callable[[], GaussianScene]], folder: Path, views: int) -> Iterator[str]:
    """Time and memory of the maps of larger and larger scans."""
    yield (
        "\n| scan | Gaussians | views | s to 10 views | s in all | MB above the scan | GB in all | load |\n" + "|---" * 8 + "|"
    )
    for label, make in scenes.items():
        path = folder / "large.ply"
        write_ply(path, make())
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            count, made, first, spent, above, peak = pool.apply(_measured, (path, views))
        path.unlink()
        load = os.getloadavg()[0]
        yield f"| {label} | {count} | {made} | {first:.0f} | {spent:.0f} | {above:.0f} | {peak / 1e9:.2f} | {load:.1f} |"
