"""Work in a thread of its own. The thread touches nothing of Blender: all inputs are copies, all news goes through a queue."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

from ...core.errors import GssmcError
from ...core.photos.photo import Photo
from ...core.pose.pins.pin import Pin
from ...core.pose.report import RefineProgress, RefineReport
from ...core.pose.settings import RefineSettings
from ...core.render.sharing import quick_handover
from ..camera.bridge import CameraCopy
from ..photo.source import PhotoSource
from ..render_gpu.executor import executor
from ..splat.renderer import SplatRenderer
from ..support.texts import sentence

log = logging.getLogger(__name__)

Steps = Generator[Any, None, Any]  # Yields progress, returns the result.


@dataclass(frozen=True)
class RefineInputs:
    """Everything a refinement needs, copied out of Blender; the renderer may be shared with others that run after it. `pins`:
    those that are to be held.
    """

    splat: SplatRenderer
    photo: PhotoSource
    camera: CameraCopy
    settings: RefineSettings
    pins: tuple[Pin, ...] = ()


@dataclass(frozen=True)
class Failure:
    """The work broke off for `error`."""

    error: Exception

    @property
    def message(self) -> str:
        """One sentence for the user. Main thread only."""
        return sentence(self.error)


@dataclass(frozen=True)
class Finished:
    """The work came to its end with `result`."""

    result: Any


def refinement(inputs: RefineInputs) -> Generator[RefineProgress, None, RefineReport]:
    """The whole work, step by step. Raises GssmcError for input that cannot be refined."""
    from ...core.pose.refine import iterate_refinement

    yield RefineProgress(0, inputs.settings.iterations, "Reading the photo", 0.0)
    photo: Photo = inputs.photo.read()
    camera = inputs.camera.at_size(photo.width, photo.height)
    yield RefineProgress(0, inputs.settings.iterations, "Preparing the splat", 0.0)
    return (yield from iterate_refinement(inputs.splat.get(), photo, camera, inputs.settings, inputs.pins))


class WorkThread:
    """Runs the steps that `work` makes in a daemon thread; `news()` is polled from the main thread."""

    def __init__(self, work: Callable[[], Steps]) -> None:
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(work,), name="gssmc-work", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Asks the thread to end at its next step; returns at once."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Waits for the thread, and draws meanwhile what it asks for; True when it has ended, or never began. Main thread."""
        return executor.wait(self._joined, timeout_s)

    def _joined(self, timeout_s: float) -> bool:
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def news(self) -> list[Any]:
        """What happened since the last call, oldest first: what the steps yielded, and Finished or Failure at the end."""
        found = []
        while not self._queue.empty():
            found.append(self._queue.get())
        return found

    def _run(self, work: Callable[[], Steps]) -> None:
        try:
            with quick_handover():  # Without this, each panel that Blender draws would wait 5 ms for the interpreter.
                self._go(work())
        except (GssmcError, MemoryError) as error:
            self._queue.put(Failure(error))
        except Exception as error:
            log.exception("The work broke off")
            self._queue.put(Failure(error))

    def _go(self, steps: Steps) -> None:
        while not self._stop.is_set():
            try:
                self._queue.put(next(steps))
            except StopIteration as end:
                self._queue.put(Finished(end.value))
                return
        steps.close()
