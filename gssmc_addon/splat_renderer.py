"""A splat object's renderer, made once and shared by all the photos of a job."""

from __future__ import annotations

from ..core.render import Renderer, RenderSettings
from .splat_copy import SplatCopying


class SplatRenderer:
    """Makes the renderer when it is first asked for, in whichever thread that is, and lets the splat's copy go. It must be
    complete by then.

    `threads`: of one view, 0 = one per core. A refinement draws its views side by side and wants 1.
    """

    def __init__(self, copying: SplatCopying, threads: int = 1) -> None:
        self._copying: SplatCopying | None = copying
        self._threads = threads
        self._renderer: Renderer | None = None

    def get(self) -> Renderer:
        """The renderer. Raises SplatFormatError, as `SplatCopy.assemble`. One thread at a time."""
        if self._renderer is None:
            scene = self._copying.copy().assemble()
            self._renderer = Renderer(scene, RenderSettings.for_scene(scene, threads=self._threads))
            self._copying = None
        return self._renderer
