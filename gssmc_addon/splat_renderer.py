"""A splat object's renderer, made once and shared by all the photos of a job."""

from __future__ import annotations

from ..core.render import Renderer, RenderSettings
from .splat_object import SplatCopy


class SplatRenderer:
    """Makes the renderer when it is first asked for, in whichever thread that is; the copy of the splat is let go then.

    `threads`: of one view, 0 = one per core. A refinement draws its views side by side and wants 1.
    """

    def __init__(self, copy: SplatCopy, threads: int = 1) -> None:
        self._copy: SplatCopy | None = copy
        self._threads = threads
        self._renderer: Renderer | None = None

    def get(self) -> Renderer:
        """The renderer. Raises SplatFormatError, as `SplatCopy.assemble`. One thread at a time."""
        if self._renderer is None:
            scene = self._copy.assemble()
            self._renderer = Renderer(scene, RenderSettings.for_scene(scene, threads=self._threads))
            self._copy = None
        return self._renderer
