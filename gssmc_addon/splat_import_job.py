"""Reading a splat file in a thread of its own, and all that can be computed of it without Blender."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.errors import Cancelled, GssmcError, SplatFormatError
from ..core.splats import read_splats
from ..core.splats.scene import GaussianScene
from . import splat_display, viewport_clouds
from .texts import n_, rpt_, sentence

log = logging.getLogger(__name__)
READING = 0.7  # share of the thread's work that is reading


@dataclass(frozen=True)
class PreparedSplat:
    """A scene with what its object and its display need beside it: base (N, 4), point radius (N,), the viewport's tables."""

    scene: GaussianScene
    base: np.ndarray
    radius: np.ndarray
    viewport: viewport_clouds.Prepared | None


def prepare(scene: GaussianScene, viewport: bool) -> PreparedSplat:
    """`viewport`: whether this Blender has one in which the extension draws splats."""
    base = np.concatenate([scene.sh[:, 0], scene.opacities[:, None]], axis=1)
    tables = viewport_clouds.prepare((scene.means, scene.scales, scene.rotations, base)) if viewport else None
    return PreparedSplat(scene, base, splat_display.point_radius(scene), tables)


class ImportJob:
    """Start it, look at `fraction`, and take `result()` once `done()`; `stop()` ends it at its next step."""

    def __init__(self, path: Path, viewport: bool) -> None:
        self.path, self.fraction = path, 0.0
        self._viewport = viewport
        self._stopped = threading.Event()
        self._result: PreparedSplat | Exception | None = None
        self._thread = threading.Thread(target=self._run, name="gssmc-import", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()

    def done(self) -> bool:
        return not self._thread.is_alive()

    def join(self) -> None:
        self._thread.join()

    def result(self) -> PreparedSplat:
        """What was read. Raises GssmcError when the file cannot be imported."""
        if isinstance(self._result, PreparedSplat):
            return self._result
        if isinstance(self._result, GssmcError):
            raise self._result
        if isinstance(self._result, MemoryError):
            raise SplatFormatError(rpt_("'{file}' does not fit into memory; close other files first.", file=self.path.name))
        raise SplatFormatError(sentence(self._result or RuntimeError()))

    def _run(self) -> None:
        try:
            scene = read_splats(self.path, self._progress)
            self._progress(1.0)
            self._result = prepare(scene, self._viewport)
        except (GssmcError, MemoryError) as error:
            self._result = error
        except Exception as error:
            log.exception("The import broke off")
            self._result = error

    def _progress(self, fraction: float) -> None:
        if self._stopped.is_set():
            raise Cancelled(n_("The import was cancelled; nothing was changed."))
        self.fraction = READING * fraction
