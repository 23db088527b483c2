"""A splat object's renderer, made once and shared by all the photos of a job."""

from __future__ import annotations

import threading

import bpy

from ...core.render import ProcessRenderer, Renderer, RenderSettings
from ...core.splats.scene import GaussianScene
from ..registration import preferences
from ..render_gpu.offer import CardOffer
from ..render_gpu.renderer import ClosingRenderer
from ..support.texts import rpt_
from .copy import SplatCopying


class SplatRenderer:
    """Makes the renderer when it is first asked for, in whichever thread that is, and lets the splat's copy go. It must be
    complete by then.

    `threads`, 0 = one per core: of a refinement, whose views come from the graphics card, or side by side from processes of
    their own (which leaves Blender its interpreter); or of a `single` view at a time, whose rendering can be stopped.
    `keeps`: the Gaussians stay in `scene`.
    """

    def __init__(self, copying: SplatCopying, threads: int = 0, single: bool = False, keeps: bool = False) -> None:
        self._copying: SplatCopying | None = copying  # None once the renderer is made.
        self._threads, self._single, self._keeps = threads, single, keeps
        self.scene: GaussianScene | None = None  # Set once the renderer is made.
        self._renderer: Renderer | ClosingRenderer | None = None
        self._closing: ClosingRenderer | None = None  # The renderer, if it is one that has to be closed.
        self._offer: CardOffer | None = None
        if not single:
            limit = preferences.memory_limit(bpy.context)
            self._offer = CardOffer(preferences.renderer(bpy.context), limit, threads)
        self._closed = False
        self._lock = threading.Lock()

    def get(self) -> Renderer | ClosingRenderer:
        """The renderer. Raises SplatFormatError, as `SplatCopy.assemble`. One thread at a time."""
        if self._renderer is None:
            assert self._copying is not None, "it goes only when the renderer is made"
            scene = self._copying.copy().assemble()
            settings = RenderSettings.for_scene(scene, threads=self._threads)
            closing = None
            if self._offer is not None:
                closing = self._offer.renderer(scene, settings, lambda: ProcessRenderer(scene, settings, interactive=True))
            self._copying, self.scene = None, scene if self._keeps else None
            with self._lock:
                self._renderer, self._closing = closing or Renderer(scene, settings), closing
            if self._closed:
                self.close()
        return self._renderer

    @property
    def remark(self) -> str:
        """A sentence on what went wrong with the graphics card, although the work went on; "" for nothing. Main thread."""
        if self._offer is None or not self._offer.fault:
            return ""
        return rpt_("The graphics card failed, and the processor drew the rest; the log says what happened.")

    def close(self) -> None:
        """Ends the processes and frees the graphics card; a refinement that still draws ends with Cancelled. Any thread, also
        before `get`.
        """
        with self._lock:
            self._closed, closing = True, self._closing
        if closing:
            closing.close()
        elif self._offer is not None:
            self._offer.close()
