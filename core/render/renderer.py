"""The fast rasteriser: per-scene tables once, then project, bin and blend per view, in bands on a thread pool."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import Cancelled
from ..geometry.camera import Intrinsics, Pose
from ..splats.scene import GaussianScene
from .blend import CHANNELS, PIXELS, BlendWork, Scratch, TileBatch, TileImage, blend_tiles
from .color import colors
from .columns import BlendColumn
from .project import TILE, SplatBuffers, ViewProjection, depth_order, project_part, seen_blocks
from .scan.blocks import Part, parts_of
from .sharing import ThreadTeam
from .tables import CHUNK, SceneTables, build_tables
from .tiles import Order, TileLists, bin_band, join_bands, plan_batches
from .view import RenderedView, RenderSettings

Float32Array = NDArray[np.float32]
IndexArray = NDArray[np.intp]
Run = Callable[..., list[Any]]

# Tiles that are binned at once.
BAND_TILES = 1024
# Bands whose lists are in memory at once. It does not depend on the number of threads, so that the image does not either.
STRIPE_BANDS = 4
# A view's room is so many times what it takes, so that the next one, which shows a little more, finds room in it.
SPARE = 1.25


def _never() -> bool:
    return False


class Renderer:
    """Draws one scene. Precomputes what is common to all views; `render` may be called from any thread."""

    def __init__(self, scene: GaussianScene | SceneTables, settings: RenderSettings | None = None) -> None:
        self.settings = settings or RenderSettings()
        self._tables = scene if isinstance(scene, SceneTables) else build_tables(scene)
        self._scratches: list[Scratch] = []
        self._buffers: list[SplatBuffers] = []

    def render(self, intrinsics: Intrinsics, pose: Pose, should_stop: Callable[[], bool] = _never) -> RenderedView:
        """Render as a pinhole (distortion ignored). `should_stop` is polled often; when it says True, raises Cancelled."""
        threads = self.settings.threads or os.cpu_count() or 1

        def poll() -> None:
            if should_stop():
                raise Cancelled("Rendering was cancelled.")

        view = ViewProjection(self._tables, intrinsics, pose, self.settings.near)
        parts = parts_of(seen_blocks(self._tables, view), len(self._tables), CHUNK)
        target, splats = _Target(intrinsics, self._scratches), self._room(parts)
        with ThreadTeam(threads) as team:
            run = team.run
            order = self._project(view, parts, splats, run, poll)
            if len(order.slots):
                for stripe in target.stripes():
                    stripe.draw(splats, order, run, poll)
        self._buffers.append(splats)
        return target.view()

    def _room(self, parts: Sequence[Part]) -> SplatBuffers:
        """Room for a view of these parts, kept from an earlier view where that has as much."""
        count = parts[-1].slots.stop if parts else 0
        try:
            splats = self._buffers.pop()
        except IndexError:
            splats = None
        if splats is None or len(splats) < count:
            splats = SplatBuffers(min(len(self._tables), int(SPARE * count)))
        return splats

    def _project(
        self, view: ViewProjection, parts: Sequence[Part], splats: SplatBuffers, run: Run, poll: Callable[[], None]
    ) -> Order:
        """Fill the splats of a view. The depth order, one thread's work, is found while others evaluate colours."""
        tables = self._tables

        def project(part: Part) -> IndexArray:
            poll()
            return project_part(tables, view, part, splats)

        def finish(part: Part | None, index: IndexArray | None) -> Order | None:
            poll()
            if part is None or index is None:
                count = parts[-1].slots.stop if parts else 0
                return Order.of(splats, depth_order(splats, count, tables.rank))
            if len(index):
                own = slice(part.slots.start, part.slots.start + len(index))
                rgb = part_colors(tables, view.centre, part, index)
                cv2.transpose(rgb, splats.table[own, BlendColumn.FEATURES : BlendColumn.FEATURES + 3])
            return None

        found = run(project, parts)
        order: Order = run(finish, [None, *parts], [None, *found])[0]
        return order


def part_colors(tables: SceneTables, centre: Float32Array, part: Part, index: IndexArray) -> Float32Array:
    """RGB (3, n) of the columns `index` (n,) of a part. Only what lies together in memory is read as it lies."""
    if len(part.runs) == 1 and 2 * len(index) >= len(tables.reach[part.runs[0]]):
        return colors(tables.color[:, :, part.runs[0]], tables.means[:, part.runs[0]], centre, index)
    return colors(tables.color, tables.means, centre, part.places(index))


class _Target:
    """The image while it is being drawn."""

    def __init__(self, k: Intrinsics, scratches: list[Scratch]) -> None:
        self.scratches = scratches
        self.k = k
        self.columns, self.rows = -(-k.width // TILE), -(-k.height // TILE)
        shape = (k.height, k.width)
        self.color = np.zeros((*shape, 3), np.float32)
        self.depth, self.alpha, self.variance = (np.zeros(shape, np.float32) for _ in range(3))

    def stripes(self) -> Iterator[_Stripe]:
        rows = max(1, BAND_TILES // self.columns)
        for begin in range(0, self.rows, STRIPE_BANDS * rows):
            yield _Stripe(self, begin, min(begin + STRIPE_BANDS * rows, self.rows))

    def view(self) -> RenderedView:
        return RenderedView(self.color, self.depth, self.alpha, self.variance)


class _Stripe:
    """Tile rows [begin, end) of the image: binned and stored by band, blended by batches of tiles with lists of one length."""

    def __init__(self, target: _Target, begin: int, end: int) -> None:
        self.target, self.begin, self.end = target, begin, end
        self.bands = [
            tuple(b) for b in pairwise(np.linspace(begin, end, min(STRIPE_BANDS, end - begin) + 1).astype(int).tolist())
        ]
        tiles = (end - begin) * target.columns
        self.image = TileImage(np.zeros((tiles, CHANNELS, PIXELS), np.float32), np.zeros(tiles, np.float32))

    def draw(self, splats: SplatBuffers, order: Order, run: Run, poll: Callable[[], None]) -> None:
        def bin_(band: tuple[int, int]) -> TileLists:
            poll()
            return bin_band(splats, order, self.target.columns, *band)

        lists = join_bands(run(bin_, self.bands))
        work = BlendWork(splats.table, lists, self.image, poll)
        run(lambda tiles: self._blend(work, tiles), plan_batches(lists.count))
        run(self._store, self.bands)

    def _blend(self, work: BlendWork, tiles: IndexArray) -> None:
        k = self.target.k
        row, column = np.divmod(tiles, self.target.columns)
        corner_x, corner_y = column * TILE, (row + self.begin) * TILE
        offset = np.arange(TILE)
        in_x, in_y = corner_x[:, None] + offset < k.width, corner_y[:, None] + offset < k.height
        inside = (in_y[:, :, None] & in_x[:, None, :]).reshape(-1, PIXELS).astype(np.float32)
        centre = np.stack([corner_x, corner_y]).astype(np.float32) + np.float32(TILE / 2)
        try:
            scratch = self.target.scratches.pop()
        except IndexError:
            scratch = Scratch()
        blend_tiles(work, TileBatch(tiles, centre, inside), scratch)
        self.target.scratches.append(scratch)

    def _store(self, band: tuple[int, int]) -> None:
        target, (begin, end) = self.target, band
        k, rows, columns = target.k, end - begin, target.columns
        tiles = slice((begin - self.begin) * columns, (end - self.begin) * columns)
        # The rows of tiles are moved as items of 32 bytes: numpy's inner loop is then a row of tiles instead of 8 floats.
        items = self.image.sums[tiles].view(f"V{4 * TILE}").reshape(rows, columns, -1, TILE).transpose(2, 0, 3, 1)
        image = np.ascontiguousarray(items).view(np.float32)
        image = image.reshape(-1, rows * TILE, columns * TILE)[:, : k.height - begin * TILE, : k.width]
        part = slice(begin * TILE, begin * TILE + image.shape[1])
        cv2.merge(list(image[:3]), target.color[part])
        target.alpha[part] = image[3]
        total = np.maximum(image[3], np.float32(1e-10))
        z0 = self.image.z0[tiles].reshape(rows, -1)
        z0 = np.repeat(np.repeat(z0, TILE, axis=0), TILE, axis=1)[: image.shape[1], : k.width]
        mean = image[4] / total
        target.depth[part] = (image[3] * z0 + image[4]) / total
        target.variance[part] = np.maximum(image[5] / total - mean * mean, np.float32(0))
