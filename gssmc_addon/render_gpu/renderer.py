"""A scan's views from the graphics card, behind the contract of `core.render.view.ViewRenderer`.

Whatever goes wrong with the card, the refinement does not end: the view in question and all later ones come from the processor.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Generator
from functools import partial
from typing import Protocol

from ...core.errors import Cancelled, GssmcError
from ...core.geometry.camera import Intrinsics, Pose
from ...core.render import RenderSettings
from ...core.render.view import RenderedView, ViewRenderer, sole_renderer
from ...core.splats.scene import GaussianScene
from . import choice
from .draw import GpuScan, ViewRequest
from .executor import Holder, executor
from .tables import MOST_GAUSSIANS, TABLE_WIDTH, ScanTexels, gpu_bytes, scan_texels, seen_points, texels_per_gaussian

log = logging.getLogger(__name__)

# Opacity from which on a view of the processor shows something that the card's empty view lacks.
SHOWS = 0.1
FAILED, BLANK = "it failed", "it drew nothing"


class ClosingRenderer(ViewRenderer, Protocol):
    """A renderer that holds processes."""

    def close(self) -> None: ...


class CardError(Exception):
    """The card drew something that cannot be."""


class GpuRenderer:
    """Draws one scan's views on the card; `render` may be called from any thread, and from several at once.

    `close` it in the end, in any thread. `fault`: what went wrong with the card, "" nothing; the processor draws from then on.
    """

    def __init__(
        self, scene: GaussianScene, settings: RenderSettings, processor: Callable[[], ClosingRenderer], owner: Holder
    ) -> None:
        """`processor` makes the renderer that takes over; `owner` holds the executor. Nothing is drawn or sent yet."""
        self._owner = owner
        self.fault = ""
        self._settings, self._make = settings, processor
        self._scan: ScanTexels | None = scan_texels(scene)
        self._there: GpuScan | None = None
        self._processor: ClosingRenderer | None = None
        self._lock = threading.Lock()
        self._closed = False

    @property
    def sole(self) -> ViewRenderer:
        """The renderer for a view that is drawn by itself; see `core.render.view.sole_renderer`."""
        return sole_renderer(self._here()) if self.fault else self

    def render(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        """Render as a pinhole (distortion ignored). Raises Cancelled when this was closed."""
        if not self.fault:
            try:
                return self._drawn(intrinsics, pose)
            except GssmcError:
                raise
            except Exception as error:  # noqa: BLE001 - as a shader that does not compile: Blender raises Exception itself
                self._give_up(error)
        return self._here().render(intrinsics, pose)

    def close(self) -> None:
        """Frees the card's memory and ends the processes; views being drawn raise Cancelled. Harmless when repeated."""
        with self._lock:
            self._closed, processor = True, self._processor
        executor.release(self._owner)
        self._free()
        if processor is not None:
            processor.close()

    def _drawn(self, intrinsics: Intrinsics, pose: Pose) -> RenderedView:
        with self._lock:
            if self._closed:
                raise Cancelled("Rendering was cancelled.")
            scan = self._scan
        if scan is None:  # another view has just failed
            raise CardError(FAILED)
        request = ViewRequest(intrinsics, pose, seen_points(scan, intrinsics, pose, self._settings.near))
        view = executor.ask(partial(self._work, scan, request), self._owner)
        if problem := choice.unfit(view):
            raise CardError(problem)
        if len(request.points) and not view.alpha.any():
            # A card that was lost gives black pictures without a word. What a view shows no part of is rare.
            right = self._here().render(intrinsics, pose)
            if right.alpha.max() > SHOWS:
                raise CardError(BLANK)
        return view

    def _work(self, scan: ScanTexels, request: ViewRequest) -> Generator[None, None, RenderedView]:
        if self.fault or self._closed:
            raise CardError(self.fault or FAILED)
        there = self._there
        if there is None:
            there = GpuScan(choice.shaders(), scan)
            yield from there.send(scan)
            self._there, self._scan = there, scan.sent()
        return (yield from there.draw(request))

    def _here(self) -> ClosingRenderer:
        """The processor's renderer, made when it is first needed."""
        with self._lock:
            if self._closed:
                raise Cancelled("Rendering was cancelled.")
            if self._processor is None:
                self._processor = self._make()
            return self._processor

    def _give_up(self, error: Exception) -> None:
        with self._lock:
            first, self.fault = not self.fault, self.fault or str(error) or repr(error)
        if first:
            log.warning("The graphics card is not used any more (%s); the processor draws on", self.fault)
            self._free()

    def _free(self) -> None:
        there, self._there, self._scan = self._there, None, None
        executor.let_go(there)
        del there
        if threading.current_thread() is threading.main_thread():
            executor.empty()


def why_not(scene: GaussianScene, spare_bytes: int | None, largest_side: int) -> str:
    """Why a scan cannot go to the card; "" when it can. `spare_bytes`: what it may take, None for no limit."""
    count, coefficients = len(scene.means), scene.sh.shape[1]
    if count >= MOST_GAUSSIANS or count * texels_per_gaussian(coefficients) > TABLE_WIDTH * largest_side:
        return "the scan has too many Gaussians for its textures"
    needed = gpu_bytes(count, coefficients)
    if spare_bytes is not None and needed > spare_bytes:
        return choice.told("the scan would take {size:.1f} GB of it, more than the memory limit leaves", size=needed / 1e9)
    return ""
