"""The fast rasteriser: per-scene tables once, then project, bin and blend per view, in bands on a thread pool."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ..camera import Intrinsics, Pose
from ..errors import Cancelled
from ..splats.scene import GaussianScene
from .blend import BandImage, Scratch, blend_band, splat_table
from .project import Splats, View, project_chunk, sort_by_depth
from .tables import CHUNK, build_tables
from .tiles import TILE, bin_band
from .view import RenderedView, RenderSettings

Float32Array = NDArray[np.float32]

BAND_TILES = 1024  # tiles per work item; fixed, so that the image does not depend on the number of threads


def _never() -> bool:
    return False


class Renderer:
    """Draws one scene. Precomputes what is common to all views; `render` may be called from any thread."""

    def __init__(self, scene: GaussianScene, settings: RenderSettings | None = None) -> None:
        self.settings = settings or RenderSettings()
        self._tables = build_tables(scene)
        self._scratches: list[Scratch] = []

    def render(self, intrinsics: Intrinsics, pose: Pose, should_stop: Callable[[], bool] = _never) -> RenderedView:
        """Render as a pinhole (distortion ignored). `should_stop` is polled often; when it says True, raises Cancelled."""
        threads = self.settings.threads or os.cpu_count() or 1

        def poll() -> None:
            if should_stop():
                raise Cancelled("Rendering was cancelled.")

        view = View(self._tables, intrinsics, pose, self.settings.near)

        def project(start: int) -> Splats | None:
            poll()
            return project_chunk(self._tables, view, slice(start, min(start + CHUNK, len(self._tables))))

        with ThreadPoolExecutor(threads) as pool:
            run = pool.map if threads > 1 else map
            parts = [p for p in run(project, range(0, len(self._tables), CHUNK)) if p is not None]
            target = _Target(intrinsics, self._scratches)
            if parts:
                splats = sort_by_depth(parts)
                table = splat_table(splats)
                rows = _band_rows(target.rows, target.columns)
                list(run(lambda r: target.draw(splats, table, r, r + rows, poll), range(0, target.rows, rows)))
        return target.view()

    def render_many(
        self, intrinsics: Intrinsics, poses: Sequence[Pose], should_stop: Callable[[], bool] = _never
    ) -> Iterator[RenderedView]:
        """The views of several poses, one after the other."""
        for pose in poses:
            yield self.render(intrinsics, pose, should_stop)


def _band_rows(rows: int, columns: int) -> int:
    """Tile rows of a band: about BAND_TILES tiles, and an even number of bands, so that two threads end together."""
    bands = -(-rows // max(1, BAND_TILES // columns))
    return -(-rows // (bands + bands % 2))


class _Target:
    """The image in the making, padded to whole tiles."""

    def __init__(self, k: Intrinsics, scratches: list[Scratch]) -> None:
        self.scratches = scratches
        self.k = k
        self.columns, self.rows = -(-k.width // TILE), -(-k.height // TILE)
        shape = (k.height, k.width)
        self.color = np.zeros((*shape, 3), np.float32)
        self.depth, self.alpha, self.variance = (np.zeros(shape, np.float32) for _ in range(3))

    def draw(self, splats: Splats, table: Float32Array, begin: int, end: int, poll: Callable[[], None]) -> None:
        poll()
        end = min(end, self.rows)
        lists = bin_band(splats, self.columns, begin, end)
        row, column = np.indices((end - begin, self.columns)).reshape(2, -1)
        corner_x, corner_y = column * TILE, (row + begin) * TILE
        offset = np.arange(TILE)
        inside = (corner_y[:, None] + offset < self.k.height)[:, :, None] & (corner_x[:, None] + offset < self.k.width)[
            :, None, :
        ]
        centres = np.stack([corner_x, corner_y]).astype(np.float32) + np.float32(TILE / 2)
        scratch = self._scratch(len(row))
        band = blend_band(table, lists, centres, inside.reshape(len(row), -1).astype(np.float32), scratch, poll)
        self.scratches.append(scratch)
        self._store(band, begin, end)

    def _scratch(self, tiles: int) -> Scratch:
        try:
            scratch = self.scratches.pop()
        except IndexError:
            return Scratch(tiles)
        return scratch if scratch.pairs >= tiles else Scratch(tiles)

    def _store(self, band: BandImage, begin: int, end: int) -> None:
        k, rows = self.k, end - begin
        image = band.sums.reshape(rows, self.columns, -1, TILE, TILE).transpose(2, 0, 3, 1, 4)
        image = image.reshape(-1, rows * TILE, self.columns * TILE)[:, : k.height - begin * TILE, : k.width]
        part = slice(begin * TILE, begin * TILE + image.shape[1])
        self.color[part] = image[:3].transpose(1, 2, 0)
        self.alpha[part] = image[3]
        total = np.maximum(image[3], np.float32(1e-10))
        z0 = np.repeat(np.repeat(band.z0.reshape(rows, -1), TILE, axis=0), TILE, axis=1)[: image.shape[1], : k.width]
        mean = image[4] / total
        self.depth[part] = (image[3] * z0 + image[4]) / total
        self.variance[part] = np.maximum(image[5] / total - mean * mean, np.float32(0))

    def view(self) -> RenderedView:
        return RenderedView(self.color, self.depth, self.alpha, self.variance)
