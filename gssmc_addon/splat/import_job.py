"""Reading a splat file in a thread of its own, and all that can be computed of it without Blender."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import Cancelled, GssmcError, SplatFormatError
from ...core.splats import read_splats
from ...core.splats.scene import GaussianScene
from ..support.texts import n_, rpt_, sentence
from ..viewport import clouds as viewport_clouds
from . import display as splat_display

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ReadSplat:
    """A scene with the attribute that is stored in another shape: base (N, 4), f_dc and opacity."""

    scene: GaussianScene
    base: np.ndarray

    @classmethod
    def of(cls, scene: GaussianScene) -> ReadSplat:
        return cls(scene, np.concatenate([scene.sh[:, 0], scene.opacities[:, None]], axis=1))


@dataclass(frozen=True)
class Look:
    """What only the display needs: point radius (N,), and the viewport's tables where the extension draws splats itself."""

    radius: np.ndarray
    viewport: viewport_clouds.Prepared | None

    @classmethod
    def of(cls, read: ReadSplat, viewport: bool) -> Look:
        """`viewport`: whether this Blender has one in which the extension draws splats."""
        arrays = read.scene.means, read.scene.scales, read.scene.rotations, read.base
        return cls(splat_display.point_radius(read.scene), viewport_clouds.prepare(arrays) if viewport else None)


class ImportJob:
    """Start it, look at `fraction`, take `read()` as soon as that is there, and `look()` once `done()`.

    So the splat can go into Blender's memory while its look is still computed. `stop()` ends it at its next step.
    """

    def __init__(self, path: Path, viewport: bool) -> None:
        self.path, self.fraction = path, 0.0  # of the reading
        self._viewport = viewport
        self._stopped = threading.Event()
        self._read: ReadSplat | None = None
        self._look: Look | None = None
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="gssmc-import", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()

    def done(self) -> bool:
        return not self._thread.is_alive()

    def join(self) -> None:
        self._thread.join()

    def read(self) -> ReadSplat | None:
        """What was read, None while there is none. Raises GssmcError when the file cannot be imported."""
        if self._error:
            raise self._refusal(self._error)
        return self._read

    def look(self) -> Look:
        """How it looks. Raises GssmcError when the file cannot be imported."""
        if self._look:
            return self._look
        raise self._refusal(self._error or RuntimeError())

    def _refusal(self, error: Exception) -> GssmcError:
        if isinstance(error, GssmcError):
            return error
        if isinstance(error, MemoryError):
            return SplatFormatError(rpt_("'{file}' does not fit into memory; close other files first.", file=self.path.name))
        return SplatFormatError(sentence(error))

    def _run(self) -> None:
        try:
            self._read = ReadSplat.of(read_splats(self.path, self._progress))
            self._progress(1.0)
            self._look = Look.of(self._read, self._viewport)
        except (GssmcError, MemoryError) as error:
            self._error = error
        except Exception as error:
            log.exception("The import broke off")
            self._error = error

    def _progress(self, fraction: float) -> None:
        if self._stopped.is_set():
            raise Cancelled(n_("The import was cancelled; nothing was changed."))
        self.fraction = fraction
