"""The import of a splat file: read in a thread, which goes on to compute its look while it is written into Blender's memory."""

from __future__ import annotations

import time
from collections.abc import Generator
from pathlib import Path

import bpy

from ...core.errors import Cancelled
from ...core.splats import read_splats
from ...core.splats.scene import GaussianScene
from ..jobs.machine import Job
from ..support.texts import iface_, n_
from .importer import Building, Placement, ReadSplat, SplatDisplay

STEP_S = 0.05  # Seconds of each tick for writing into Blender's memory; a single attribute may take longer.
READING = 0.8  # share of the progress shown


class SplatImport(Job):
    """The import of `path`. Its result is the job itself, whose `finish()` brings the splat into the scene."""

    at_mouse = True
    tick_s = 0.03

    def __init__(self, path: Path, placement: Placement, viewport: bool) -> None:
        """`viewport`: whether this Blender has one in which the extension draws splats."""
        super().__init__(self._steps)
        self.status = iface_("Importing {file}    Esc: cancel", file=path.name)
        self.step = n_("Reading the splat")
        self._path, self._placement, self._viewport = path, placement, viewport
        self._read_share = 0.0  # written by the thread
        self._building: Building | None = None
        self._built = False
        self._look: SplatDisplay | None = None

    def _steps(self) -> Generator[ReadSplat, None, SplatDisplay]:
        read = ReadSplat.of(read_splats(self._path, self._progress, self._placement.level))
        yield read
        return SplatDisplay.of(read, self._viewport)

    def _progress(self, fraction: float) -> None:
        """In the thread, many times while the file is read."""
        if self.cancelled:
            raise Cancelled(n_("The import was cancelled; nothing was changed."))
        self._read_share = fraction

    def on_progress(self, news: ReadSplat) -> None:
        self.step = n_("Making the splat")
        self._building = Building(self._path.stem, news, self._placement)

    def advance(self) -> SplatImport | None:
        begun = self._building is not None
        self._look = super().advance() or self._look
        self.show()
        if not begun or self._building is None:  # Blender redraws once before the first step.
            self.fraction = READING * self._read_share
            return None
        until = time.perf_counter() + STEP_S
        while not self._built and time.perf_counter() < until:
            self._built = self._building.step()
        self.fraction = READING + (1 - READING) * self._building.fraction
        return self if self._built and self._look else None

    def finish(self, context: bpy.types.Context) -> tuple[bpy.types.Object, GaussianScene]:
        """The splat object, in Blender's scene, and what the file held.

        Raises SplatFormatError when its data is gone, Cancelled after `cancel`.
        """
        if self._building is None or self._look is None:
            raise Cancelled(n_("The import was cancelled; nothing was changed."))
        obj, scene = self._building.finish(context, self._look), self._building.scene
        self._building = None
        obj.gssmc.file = str(self._path)
        return obj, scene

    def cancel(self) -> None:
        """Also removes what was made so far, unless `finish()` has brought it into the scene."""
        super().cancel()
        building, self._building = self._building, None
        if building:
            building.drop()
