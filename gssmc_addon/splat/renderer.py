"""A splat object's renderer, made once and shared by all the photos of a job."""

from __future__ import annotations

import threading

from ...core.render import ProcessRenderer, Renderer, RenderSettings
from .copy import SplatCopying


class SplatRenderer:
    """Makes the renderer when it is first asked for, in whichever thread that is, and lets the splat's copy go. It must be
    complete by then.

    `threads`, 0 = one per core: of a refinement, which draws its views side by side in processes of their own (and leaves
    Blender its interpreter), or of a `single` view at a time, whose rendering can be stopped.
    """

    def __init__(self, copying: SplatCopying, threads: int = 0, single: bool = False) -> None:
        self._copying = copying  # It is empty once the renderer is made.
        self._threads, self._single = threads, single
        self._renderer: Renderer | ProcessRenderer | None = None
        self._processes: ProcessRenderer | None = None  # The renderer, if it is one that draws in processes.
        self._closed = False
        self._lock = threading.Lock()

    def get(self) -> Renderer | ProcessRenderer:
        """The renderer. Raises SplatFormatError, as `SplatCopy.assemble`. One thread at a time."""
        if self._renderer is None:
            scene = self._copying.copy().assemble()
            settings = RenderSettings.for_scene(scene, threads=self._threads)
            processes = None if self._single else ProcessRenderer(scene, settings, interactive=True)
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
