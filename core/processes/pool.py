"""Worker processes of a batch: started, fed, replaced when one dies, and ended with the batch."""

from __future__ import annotations

import json
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any

from ..errors import GssmcError, RefineError, SplatFormatError
from .child import ONE_THREAD, Child

POLL_S = 0.2

Record = dict[str, Any]


class WorkerDiedError(Exception):
    """A worker process ended in the middle of a job; str() is what it last said."""


class Worker:
    """One worker process. `ask` blocks until the answer is there."""

    def __init__(self, first: Record) -> None:
        self._child = Child("batch.worker", ONE_THREAD)
        self._first = first

    def start(self) -> int:
        """Wait until the scene is read; returns how many Gaussians were left out. Raises SplatFormatError, RefineError."""
        try:
            answer = self.ask(self._first)
        except WorkerDiedError as error:
            raise RefineError(f"A worker process ended while it read the scan ({error}); use fewer --workers.") from None
        if "error" in answer:
            raise SplatFormatError(answer["error"])
        return int(answer["dropped"])

    def ask(self, job: Record) -> Record:
        try:
            self._child.stdin.write(json.dumps(job).encode() + b"\n")
            self._child.stdin.flush()
            line = self._child.stdout.readline()
        except (BrokenPipeError, ValueError, OSError):
            line = b""
        if not line:
            raise WorkerDiedError(self._child.last_words())
        answer: Record = json.loads(line)
        return answer

    def kill(self) -> None:
        """End the process. The thread that waits for its answer hears of it as of any death; it alone may `close`."""
        self._child.kill()

    def close(self) -> None:
        self._child.close()


class Pool:
    """Runs jobs over several workers; a context manager that leaves no process behind."""

    def __init__(self, first: Record, workers: int) -> None:
        self._first = first
        self._workers = workers
        self._alive: set[Worker] = set()
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

    def run(
        self, jobs: Sequence[tuple[int, Record]], lost: Callable[[int, str], Record], started: Callable[[int], None]
    ) -> Iterator[tuple[int, Record]]:
        """Yields (index, record) as jobs end. A worker that dies costs its job, whose record `lost(index, words)` makes.

        `started` hears from each worker how many Gaussians it left out. Raises GssmcError when workers cannot start.
        """
        todo: queue.SimpleQueue[tuple[int, Record]] = queue.SimpleQueue()
        done: queue.SimpleQueue[tuple[int, Record] | GssmcError | int] = queue.SimpleQueue()
        for job in jobs:
            todo.put(job)
        for _ in range(min(self._workers, len(jobs))):
            self._threads.append(threading.Thread(target=self._serve, args=(todo, done, lost), daemon=True))
            self._threads[-1].start()
        count = 0
        while count < len(jobs):
            try:
                item = done.get(timeout=POLL_S)  # a wait without end would not hear Ctrl-C on every system
            except queue.Empty:
                continue
            if isinstance(item, GssmcError):
                raise item
            if isinstance(item, int):
                started(item)
                continue
            count += 1
            yield item

    def _serve(
        self,
        todo: queue.SimpleQueue[tuple[int, Record]],
        done: queue.SimpleQueue[tuple[int, Record] | GssmcError | int],
        lost: Callable[[int, str], Record],
    ) -> None:
        worker: Worker | None = None
        try:
            while not self._stop.is_set():
                index, job = todo.get_nowait()
                if worker is None:
                    worker = self._new_worker(done)
                try:
                    done.put((index, worker.ask(job)))
                except WorkerDiedError as words:
                    self._end(worker)
                    worker = None
                    done.put((index, lost(index, str(words))))
        except queue.Empty:
            pass
        except GssmcError as error:
            done.put(error)
        finally:
            if worker is not None:
                self._end(worker)

    def _new_worker(self, done: queue.SimpleQueue[tuple[int, Record] | GssmcError | int]) -> Worker:
        worker = Worker(self._first)
        with self._lock:
            self._alive.add(worker)
        if self._stop.is_set():  # the batch ended between the check and the start
            worker.kill()
        done.put(worker.start())
        return worker

    def _end(self, worker: Worker) -> None:
        with self._lock:
            self._alive.discard(worker)
        worker.close()
