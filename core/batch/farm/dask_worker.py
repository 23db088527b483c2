"""A batch on the side of a Dask worker: one process per worker that holds the scan, opened by its path and kept between photos.

The photos are refined in the same process as in a batch on one machine (`batch.worker`), so a photo that ends its process costs
one photo and not the Dask worker, and the answers are the same. That process ends with the batch, with the Dask worker, and
when no photo has come for IDLE_S, because the batch may have been killed.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker

from ...processes.channel import Channel, ChildEndedError
from ...processes.child import ONE_THREAD, Child
from ...processes.pool import START_LIMIT_S, TASK_LIMIT_S
from .versions import difference, versions

IDLE_S = 300.0

Record = dict[str, Any]


class ScanPlugin(WorkerPlugin):
    """Holds a batch's scan on a Dask worker. It travels with each task, as a path and some words; the first to arrive stays."""

    def __init__(self, name: str, first: Record, expected: dict[str, str]) -> None:
        """`name`: of the batch, unlike any other's; `first`: the first message of its processes, see `batch.worker`;
        `expected`: the `versions` of the machine that keeps the results.
        """
        self.name, self._first, self._expected = name, first, expected

    def setup(self, worker: Worker) -> None:
        self._address = str(worker.address)
        self._lock = threading.Lock()
        self._channel: Channel | None = None
        self._idle: threading.Timer | None = None
        self._closed = False

    def teardown(self, worker: Worker) -> None:
        """Ends the process, also in the middle of a photo. The event loop calls it, so it does not wait for the lock."""
        self._closed = True
        channel = self._channel
        if channel is not None:
            channel.kill()

    def answer(self, task: Record) -> Record:
        """{"record"} of the photo, with "dropped" where the scan was opened for it; {"lost": words} when its process ended; or
        {"unusable": sentence, "worker": address} when this worker can do no photo at all.
        """
        with self._lock:
            if self._idle is not None:
                self._idle.cancel()
            try:
                opened = self._open()
            except _UnusableError as error:
                return {"unusable": str(error), "worker": self._address}
            found = self._asked(task)
            if not self._closed:
                self._idle = threading.Timer(IDLE_S, self._rest)
                self._idle.daemon = True
                self._idle.start()
            return found | opened

    def _open(self) -> Record:
        """Starts the process where there is none. Raises _UnusableError."""
        if self._channel is not None:
            return {}
        if other := difference(self._expected, versions()):
            raise _UnusableError(f"has {other}, and its answers may differ; install the same there")
        try:
            self._channel = Channel(Child("batch.worker", ONE_THREAD))
            if self._closed:
                self._channel.kill()
            answer, _ = self._channel.ask(self._first, limit_s=START_LIMIT_S)
        except OSError as error:
            raise _UnusableError(f"can start no process ({error.strerror or error})") from None
        except ChildEndedError as error:
            self._channel = None
            raise _UnusableError(f"lost its process while it read the scan ({error}); give it more memory") from None
        if "error" in answer:
            self._shut()
            raise _UnusableError(f"cannot open the scan: {answer['error'].rstrip('.')}")
        return {"dropped": int(answer["dropped"])}

    def _asked(self, task: Record) -> Record:
        assert self._channel is not None
        try:
            return {"record": self._channel.ask(task, limit_s=TASK_LIMIT_S)[0]}
        except ChildEndedError as end:
            self._shut()
            return {"lost": str(end)}

    def _rest(self) -> None:
        with self._lock:
            self._shut()

    def _shut(self) -> None:
        channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()


class _UnusableError(Exception):
    """This worker can do no photo; str() goes on after its address."""


def answer(plugin: ScanPlugin, task: Record) -> Record:
    """A task of the client: `ScanPlugin.answer` of the plugin of that name that the worker holds."""
    worker = get_worker()
    if plugin.name not in worker.plugins:
        plugin.setup(worker)
    held: ScanPlugin = worker.plugins.setdefault(plugin.name, plugin)
    return held.answer(task)


class Call:
    """A task as bytes: unpickled, it is the answer. The scheduler reads the tasks that it hands on, and has to know nothing of
    the engine for that.
    """

    def __init__(self, plugin: ScanPlugin, task: Record) -> None:
        self._arguments = plugin, task

    def __reduce__(self) -> tuple[Callable[..., Record], tuple[ScanPlugin, Record]]:
        return answer, self._arguments


def dask_setup(worker: Worker) -> None:
    """Dask calls it in the workers that are started on this machine: Ctrl-C reaches the whole group of processes, and it is
    left to the batch to end them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)


async def forget(name: str, dask_worker: Worker) -> None:
    """Ends what a batch has left on a worker."""
    if name in dask_worker.plugins:
        await dask_worker.plugin_remove(name=name)
