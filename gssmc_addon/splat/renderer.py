"""A splat object's renderer, made once and shared by all the photos of a job."""

from __future__ import annotations

import threading

from ...core.render import ProcessRenderer, Renderer, RenderSettings
from ...core.splats.scene import GaussianScene
from .copy import SplatCopying


class SplatRenderer:
    """Makes the renderer when it is first asked for, in whichever thread that is, and lets the splat's copy go. It must be
    complete by then.

    `threads`, 0 = one per core: of a refinement, which draws its views side by side in processes of their own (and leaves
    Blender its interpreter), or of a `single` view at a time, whose rendering can be stopped.
    `keeps`: the Gaussians stay in `scene`.
    """

    def __init__(self, copying: SplatCopying, threads: int = 0, single: bool = False, keeps: bool = False) -> None:
        self._copying: SplatCopying | None = copying  # None once the renderer is made.
        self._threads, self._single, self._keeps = threads, single, keeps
        self.scene: GaussianScene | None = None  # Set once the renderer is made.
        self._renderer: Renderer | ProcessRenderer | None = None
        self._processes: ProcessRenderer | None = None  # The renderer, if it is one that draws in processes.
        self._closed = False
        self._lock = threading.Lock()

    def get(self) -> Renderer | ProcessRenderer:
        """The renderer. Raises SplatFormatError, as `SplatCopy.assemble`. One thread at a time."""
        if self._renderer is None:
            assert self._copying is not None, "it goes only when the renderer is made"
            scene = self._copying.copy().assemble()
            settings = RenderSettings.for_scene(scene, threads=self._threads)
            processes = None if self._single else ProcessRenderer(scene, settings, interactive=True)
            self._copying, self.scene = None, scene if self._keeps else None
            with self._lock:
                self._renderer, self._processes = processes or Renderer(scene, settings), processes
            if self._closed:
                self.close()
        return self._renderer

    def close(self) -> None:
        """Ends the processes; a refinement that still draws ends with Cancelled. Any thread, also before `get`."""
        with self._lock:
            self._closed, processes = True, self._processes
        if processes:
            processes.close()
