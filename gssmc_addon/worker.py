"""The refinement in a thread of its own. Nothing here touches Blender: all inputs are copies, all news goes through a queue."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Generator
from dataclasses import dataclass

from ..core.errors import GssmcError
from ..core.photo import Photo
from ..core.pose.report import RefineProgress, RefineReport
from ..core.pose.settings import RefineSettings
from .camera_bridge import CameraCopy
from .photo_image import PhotoSource
from .splat_object import SplatCopy

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RefineInputs:
    """Everything a refinement needs, copied out of Blender."""

    splat: SplatCopy
    photo: PhotoSource
    camera: CameraCopy
    settings: RefineSettings


@dataclass(frozen=True)
class Failure:
    """The refinement broke off; `message` is one sentence for the user."""

    message: str


News = RefineProgress | RefineReport | Failure


def refinement(inputs: RefineInputs) -> Generator[RefineProgress, None, RefineReport]:
    """The whole work, step by step. Raises GssmcError for input that cannot be refined."""
    from ..core.pose.refine import iterate_refinement
    from ..core.render import Renderer, RenderSettings

    yield RefineProgress(0, inputs.settings.iterations, "Reading the photo", 0.0)
    photo: Photo = inputs.photo.read()
    camera = inputs.camera.at_size(photo.width, photo.height)
    yield RefineProgress(0, inputs.settings.iterations, "Preparing the splat", 0.0)
    scene = inputs.splat.assemble()
    renderer = Renderer(scene, RenderSettings.for_scene(scene, threads=1))  # the refinement draws its views side by side
    return (yield from iterate_refinement(renderer, photo, camera, inputs.settings))


class Worker:
    """Runs a refinement in a daemon thread; `news()` is polled from the main thread."""

    def __init__(self, inputs: RefineInputs) -> None:
        self._queue: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(inputs,), name="gssmc-refine", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Asks the thread to end at its next step; returns at once."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Waits for the thread; True when it has ended."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def news(self) -> list[News]:
        """What happened since the last call, oldest first."""
        found = []
        while not self._queue.empty():
            found.append(self._queue.get())
        return found

    def _run(self, inputs: RefineInputs) -> None:
        try:
            steps = refinement(inputs)
            while not self._stop.is_set():
                try:
                    self._queue.put(next(steps))
                except StopIteration as end:
                    self._queue.put(end.value)
                    return
            steps.close()
        except GssmcError as error:
            self._queue.put(Failure(str(error)))
        except MemoryError:
            self._queue.put(Failure("There is not enough memory for this splat; close other files or use a smaller scan."))
        except Exception as error:
            log.exception("The refinement broke off")
            self._queue.put(Failure(f"The refinement broke off ({type(error).__name__}); the system console has the details."))
