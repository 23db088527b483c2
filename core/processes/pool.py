"""Worker processes of a batch: started, fed, replaced when one dies, and ended with the batch."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

from ..errors import RefineError, SplatFormatError
from .channel import Channel, ChildEndedError
from .child import ONE_THREAD, Child

log = logging.getLogger(__name__)

POLL_S = 0.2
# For reading the scan, which may lie on a slow disk.
START_LIMIT_S = 3600.0
# For one photo. A worker that needs longer hangs.
TASK_LIMIT_S = 3600.0

Record = dict[str, Any]
Task = tuple[int, Record]
Lost = Callable[[int, str], Record]


@dataclass(frozen=True)
class _Ended:
    """A pool thread has ended: well, or for `error`."""

    error: Exception | None


@dataclass(frozen=True)
class _Queues:
    """What is to be done, as (index, task), and what came of it: (index, record), how many Gaussians a worker that has come up
    left out, or the end of a thread.
    """

    todo: queue.SimpleQueue[Task] = field(default_factory=queue.SimpleQueue)
    done: queue.SimpleQueue[Task | int | _Ended] = field(default_factory=queue.SimpleQueue)


class Pool:
    """Runs tasks over several workers; a context manager that leaves no process behind."""

    def __init__(self, first: Record, workers: int) -> None:
        """`first` is the first message of each worker, see `batch.worker`."""
        self._first = first
        self._workers = workers
        self._alive: set[Channel] = set()
        self._threads: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stop.set()
        with self._lock:
            alive = list(self._alive)
        for worker in alive:
            worker.kill()
        for thread in self._threads:
            thread.join()

    def run(self, tasks: Sequence[Task], lost: Lost, started: Callable[[int], None]) -> Iterator[Task]:
        """Yields (index, record) as tasks end. A worker that dies costs its task, whose record `lost(index, reason)` makes.

        `started` hears from each worker how many Gaussians it left out. A worker that cannot start is done without, which is
        logged. Raises RefineError when there is none left, SplatFormatError when the first of them cannot read the scan, and
        whatever else a thread of the pool broke down of.
        """
        queues = _Queues()
        for task in tasks:
            queues.todo.put(task)
        self._start_threads(min(self._workers, len(tasks)), queues, lost)
        running, count, came_up = len(self._threads), 0, False
        while count < len(tasks):
            try:
                # Not every system interrupts a wait without a time limit at Ctrl-C.
                item = queues.done.get(timeout=POLL_S)
            except queue.Empty:
                continue
            if isinstance(item, _Ended):
                running -= 1
                _judge(item.error, running, came_up)
            elif isinstance(item, int):
                came_up = True
                started(item)
            else:
                count += 1
                yield item

    def _start_threads(self, count: int, queues: _Queues, lost: Lost) -> None:
        for _ in range(count):
            thread = threading.Thread(target=self._serve, args=(queues, lost), daemon=True)
            try:
                thread.start()
            except RuntimeError as error:  # the system has no more threads to give
                if not self._threads:
                    raise RefineError(f"No thread for a worker can be started ({error}); end other programs.") from None
                break
            self._threads.append(thread)

    def _serve(self, queues: _Queues, lost: Lost) -> None:
        error: Exception | None = None
        try:
            self._work(queues, lost)
        except Exception as broken:  # noqa: BLE001 - the thread that waits for us judges it, and must hear of every end
            error = broken
        queues.done.put(_Ended(error))

    def _work(self, queues: _Queues, lost: Lost) -> None:
        """Does tasks until there are none left."""
        worker: Channel | None = None
        try:
            while not self._stop.is_set():
                if worker is None:
                    if queues.todo.empty():
                        return
                    worker = self._new_worker(queues)  # before a task is taken, which nobody else could do then
                index, task = queues.todo.get_nowait()
                try:
                    queues.done.put((index, worker.ask(task, limit_s=TASK_LIMIT_S)[0]))
                except ChildEndedError as end:
                    self._end(worker)
                    worker = None
                    queues.done.put((index, lost(index, str(end))))
        except queue.Empty:
            pass
        finally:
            if worker is not None:
                self._end(worker)

    def _new_worker(self, queues: _Queues) -> Channel:
        """A worker that has read the scan. Raises OSError, RefineError or SplatFormatError."""
        worker = Channel(Child("batch.worker", ONE_THREAD))
        with self._lock:
            self._alive.add(worker)
        if self._stop.is_set():  # the batch ended between the check and the start
            worker.kill()
        try:
            answer, _ = worker.ask(self._first, limit_s=START_LIMIT_S)
            if "error" in answer:
                raise SplatFormatError(answer["error"])
            queues.done.put(int(answer["dropped"]))
        except ChildEndedError as error:
            self._end(worker)
            raise RefineError(f"A worker process ended while it read the scan ({error}); use fewer --workers.") from None
        except BaseException:
            self._end(worker)
            raise
        return worker

    def _end(self, worker: Channel) -> None:
        with self._lock:
            self._alive.discard(worker)
        worker.close()


def _judge(error: Exception | None, running: int, came_up: bool) -> None:
    """Called while there are tasks to do, when a thread has ended and `running` others have not: raises what ends the batch."""
    if isinstance(error, OSError):
        error = RefineError(f"A worker process cannot be started ({error.strerror or error}); use fewer --workers.")
    if isinstance(error, SplatFormatError) and not came_up:
        raise error  # the others would say the same
    if error is not None and not isinstance(error, RefineError | SplatFormatError):
        raise error
    if running == 0:
        raise error or RefineError("The worker processes have ended before their work was done; start the batch again.")
    if error is not None:
        log.warning("%s The batch goes on with %d.", error, running)
