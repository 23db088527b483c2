"""A download in a thread of its own, watched by the operator that started it. Nothing here touches Blender."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

from ..core.download import DownloadProgress, download
from ..core.errors import GssmcError
from ..core.models import KnownModel

News = DownloadProgress | Path | GssmcError


class ModelDownload:
    """One download: `start()`, then `news()` from the main thread until it brings a Path or an error."""

    def __init__(self, model: KnownModel, url: str, folder: Path) -> None:
        self._queue: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._stop = threading.Event()
        arguments = (model, url, folder)
        self._thread = threading.Thread(target=self._run, args=arguments, name="gssmc-download", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Asks the thread to end at its next step; what came so far is kept for the next time."""
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

    def _run(self, model: KnownModel, url: str, folder: Path) -> None:
        steps = download(model, url, folder)
        try:
            while not self._stop.is_set():
                self._queue.put(next(steps))
            steps.close()
        except StopIteration as end:
            self._queue.put(end.value)
        except GssmcError as error:
            self._queue.put(error)
