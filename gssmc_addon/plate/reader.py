"""Frames of a plate for a thread: those that Blender alone decodes (OpenEXR) are handed over by the main thread, one by one."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass, field

from ...core.errors import GssmcError, PhotoError
from ...core.photos.photo import Photo
from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..photo.source import PhotoSource
from ..support.texts import n_
from . import source as plate_source
from .source import MovingPhoto

ENDED = n_("The work has ended, and no frame is read any more.")


@dataclass(eq=False)
class _Wanted:
    """A frame that a thread waits for."""

    frame: int
    ready: threading.Event = field(default_factory=threading.Event)
    photo: Photo | None = None
    error: GssmcError | None = None


class PlateReader:
    """Reads the plate's frames, by frames of the scene, with the camera's mask. `read` is for the work's thread; `serve`
    for the main thread, which has to call it again and again meanwhile, and `stop` when the work ends.
    """

    def __init__(self, plate: MovingPhoto, mask: PhotoSource | Photo | None) -> None:
        self._plate, self._mask = plate, mask
        self._through_blender = not plate.plate.is_movie and photo_image.is_linear(str(plate.plate.path))
        self._queue: queue.SimpleQueue[_Wanted] = queue.SimpleQueue()
        self._stopped = threading.Event()

    def source(self, frame: int) -> PhotoSource:
        """The frame of the scene's `frame`, as a source whose `read` may be called in any thread."""
        return mask_source.masked(_ReadLater(self, frame), self._mask)

    def read(self, frame: int) -> Photo:
        """The frame of the scene's `frame`. Raises PhotoError."""
        photo: Photo = self.source(frame).read()
        return photo

    def serve(self) -> None:
        """Decodes the frames that threads wait for. Main thread only."""
        while not self._queue.empty():
            wanted = self._queue.get()
            try:
                wanted.photo = self._plate.frame_at(wanted.frame).read()
            except GssmcError as error:
                wanted.error = error
            wanted.ready.set()

    def stop(self) -> None:
        """Lets go of threads that wait for a frame."""
        self._stopped.set()

    def decoded(self, frame: int) -> Photo:
        """The frame without the mask. Raises PhotoError."""
        if not self._through_blender:
            return plate_source.FrameSource(self._plate.plate, frame + self._plate.offset).read()
        wanted = _Wanted(frame)
        self._queue.put(wanted)
        if threading.current_thread() is threading.main_thread():
            self.serve()
        while not wanted.ready.wait(0.1):
            if self._stopped.is_set():
                raise PhotoError(ENDED)
        if wanted.photo is None:
            raise wanted.error or PhotoError(ENDED)
        return wanted.photo

    def name_of(self, frame: int) -> str:
        return f"{self._plate.plate.path.name} {frame + self._plate.offset}"

    @property
    def path(self) -> str:
        return str(self._plate.plate.path)


@dataclass(frozen=True)
class _ReadLater:
    """One frame of a reader; a PhotoSource."""

    reader: PlateReader
    frame: int

    @property
    def name(self) -> str:
        return self.reader.name_of(self.frame)

    @property
    def path(self) -> str:
        return self.reader.path

    def read(self) -> Photo:
        return self.reader.decoded(self.frame)
