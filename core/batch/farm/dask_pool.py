"""The tasks of a batch on the workers of a Dask cluster: handed out a few at a time, and done again where a worker was lost.

Only this side writes results. Whatever becomes of workers or scheduler, a task ends with one record, or stays undone.
"""

from __future__ import annotations

import logging
import pickle
import pkgutil
import queue
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

from distributed import Client, Future, KilledWorker, LocalCluster

from ...errors import RefineError
from ...processes.pool import Lost, Task
from .dask_scheduler import why_no_scheduler
from .dask_worker import Call, ScanPlugin, dask_setup, forget
from .versions import versions

log = logging.getLogger(__name__)

POLL_S = 0.2
LOOK_S = 1.0  # between two looks at which workers there are
CONNECT_S = 10.0
# So long a scheduler may be away, and so long there may be no worker.
PATIENCE_S = 600.0
GRACE_S = 3.0  # before a cluster of which no worker can be used is given up
AHEAD = 2  # tasks per worker that are handed out at a time: one is done, one waits
TRIES = 3  # of a task that fails for a reason that is not its photo's
PACKAGE, PART = "core", "batch/farm/dask_worker.py"  # what a worker must have

Record = dict[str, Any]
SUBMITTED = tuple[int, Future]


@dataclass
class _UnderWay:
    """Tasks by index: what is to be done, and what is under way; how often each failed, and what has ended since."""

    todo: deque[Task]
    tasks: dict[int, Record]
    flying: dict[int, Future] = field(default_factory=dict)
    failed: Counter[int] = field(default_factory=Counter)

    def again(self, index: int) -> None:
        self.todo.appendleft((index, self.tasks[index]))

    def all_again(self) -> None:
        for index in sorted(self.flying, reverse=True):
            del self.flying[index]
            self.again(index)


class DaskPool:
    """As `processes.pool.Pool`, over the workers of a Dask scheduler, or of one that is started here with `workers` of them."""

    def __init__(self, first: Record, workers: int, address: str | None) -> None:
        """`first` is the first message of each worker process, see `batch.worker`; its paths must lead to the same files on
        all machines.
        """
        self._plugin = ScanPlugin(f"gssmc-{secrets.token_hex(6)}", first, versions())
        self._count, self._address = workers, address
        self._ended: queue.SimpleQueue[SUBMITTED] = queue.SimpleQueue()
        self._known: set[str] = set()
        self._left_out: dict[str, str] = {}
        self._looked = self._seen = 0.0
        self._said: set[str] = set()
        self._cluster: LocalCluster | None = None
        self._client: Client
        self._connection: Any = None

    def __enter__(self) -> DaskPool:
        """Raises RefineError when there is no scheduler."""
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters of it we say ourselves
        try:
            if self._address is None:
                self._cluster = LocalCluster(
                    n_workers=self._count,
                    threads_per_worker=1,
                    preload=[dask_setup.__module__],
                    memory_limit=0,
                    dashboard_address=None,
                    # Its web server takes any free port; of its own one it warns where that is taken.
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    silence_logs=logging.CRITICAL,
                )
            self._client = self._connected()
        except (OSError, ValueError, RuntimeError) as error:
            where = "can be started here" if self._address is None else f"answers at '{self._address}'"
            words = " ".join(str(error).split())[:200]
            raise RefineError(
                f"No Dask scheduler {where} ({words}); start one with 'dask scheduler', or take --executor local."
            ) from None
        self._seen = time.monotonic()
        return self

    def _connected(self) -> Client:
        """A client of the scheduler. Raises OSError, ValueError or RuntimeError where there is none."""
        if self._cluster is None and self._address is not None and (words := why_no_scheduler(self._address, CONNECT_S)):
            raise ConnectionError(words)
        return Client(self._cluster or self._address, timeout=CONNECT_S, set_as_default=False)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            if self._client.status == "running":
                self._client.run(forget, self._plugin.name, on_error="ignore")
        except (OSError, RuntimeError, CancelledError) as problem:
            log.debug("The workers were not told of the batch's end: %s", problem)
        finally:
            self._client.close(timeout=CONNECT_S)
            if self._cluster is not None:
                self._cluster.close(timeout=CONNECT_S)

    def run(self, tasks: Sequence[Task], lost: Lost, started: Callable[[int], None]) -> Iterator[Task]:
        """As `Pool.run`. A task whose Dask worker is lost is done by another one, a few times. Raises RefineError when no
        worker can do any, or the scheduler or its workers stay away.
        """
        work = _UnderWay(deque(tasks), dict(tasks))
        done = 0
        while done < len(tasks):
            self._look(work)
            self._hand_out(work)
            try:
                index, future = self._ended.get(timeout=POLL_S)
            except queue.Empty:
                continue
            if work.flying.get(index) is not future:
                continue  # of a connection that was lost meanwhile
            del work.flying[index]
            found = self._result(work, index, future)
            if "dropped" in found:
                started(found["dropped"])
            if "unusable" in found:
                self._leave_out(found["worker"], found["unusable"])
            if "record" in found or "lost" in found:
                done += 1
                yield index, found["record"] if "record" in found else lost(index, found["lost"])
            else:
                work.again(index)

    def _hand_out(self, work: _UnderWay) -> None:
        usable = self._known - self._left_out.keys()
        while work.todo and len(work.flying) < AHEAD * len(usable):
            index, task = work.todo[0]
            key = f"{self._plugin.name}-{index}-{secrets.token_hex(4)}"
            call = pickle.dumps(Call(self._plugin, task))
            where = {"workers": sorted(usable), "allow_other_workers": True}
            try:
                future = self._client.submit(pickle.loads, call, key=key, pure=False, **where)
            except Exception as error:  # noqa: BLE001 - Dask has no kind of its own for a client that was closed meanwhile
                log.debug("Nothing can be handed out: %s", error)
                return
            work.todo.popleft()
            work.flying[index] = future
            future.add_done_callback(lambda ended, index=index: self._ended.put((index, ended)))

    def _result(self, work: _UnderWay, index: int, future: Future) -> Record:
        """What came of a task; nothing where it is to be done again."""
        try:
            found: Record = future.result(timeout=CONNECT_S)
            return found
        except KilledWorker as error:
            return {"lost": f"{error.last_worker.address if error.last_worker else 'its machine'} and others ended with it"}
        except (CancelledError, OSError, TimeoutError):  # the scheduler is gone, or the worker before it could hand over
            return {}
        except Exception as error:  # noqa: BLE001 - whatever a task may raise there, it must not end the others
            work.failed[index] += 1
            words = " ".join(str(error).split())[:200].rstrip(".")
            return {"lost": words} if work.failed[index] >= TRIES else {}

    def _look(self, work: _UnderWay) -> None:
        """Keeps the list of workers up to date, at most every LOOK_S. Raises RefineError when they stay away."""
        now = time.monotonic()
        if now - self._looked < LOOK_S:
            return
        self._looked = now
        there = self._workers(work)
        unsure = there - self._known - self._left_out.keys()
        self._known = (self._known & there) | {address for address in sorted(unsure) if self._has_engine(address)}
        there &= self._known | self._left_out.keys()
        away = now - self._seen
        if there - self._left_out.keys():
            self._seen = now
        elif there and away > GRACE_S:
            raise RefineError(f"No worker can be used: {self._left_out[min(there)]}")
        elif away > PATIENCE_S:
            raise RefineError(f"No Dask worker came within {PATIENCE_S:.0f} s; start some, and give the same command again.")
        elif not there:
            self._say_once(f"The Dask scheduler {self._where} has no worker; waiting for one.")

    def _workers(self, work: _UnderWay) -> set[str]:
        """The addresses of the workers; none while there is no scheduler, which is looked for again."""
        try:
            if self._client.status == "running":
                # What was handed out on another connection is lost, or was never heard.
                if self._client.scheduler_comm is not self._connection:
                    work.all_again()
                    self._connection = self._client.scheduler_comm
                return set(self._client.nthreads())
            self._say_once(f"The Dask scheduler {self._where} is gone; waiting for it. What is finished is kept.")
            work.all_again()
            if self._client.status == "closed" and self._cluster is None:
                self._client = self._connected()
                self._said.clear()
        except (OSError, RuntimeError, CancelledError, TimeoutError) as error:
            log.debug("No answer from the scheduler: %s", error)
        return set()

    @property
    def _where(self) -> str:
        return "of this machine" if self._address is None else f"at '{self._address}'"

    def _say_once(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            log.warning("%s", sentence)

    def _has_engine(self, address: str) -> bool:
        """Whether the engine is installed on a worker; one on which it is not is left out. False also where no answer came."""
        try:
            found = self._client.run(pkgutil.get_data, PACKAGE, PART, workers=[address], on_error="return")
        except (OSError, RuntimeError, CancelledError, TimeoutError) as error:
            log.debug("No answer from the worker at %s: %s", address, error)
            return False
        answer = found.get(address, ConnectionError())
        if answer is None or isinstance(answer, ImportError | FileNotFoundError):
            self._leave_out(address, "has no GS-SMC; start it in the checkout's folder, or with that on its PYTHONPATH")
        return isinstance(answer, bytes)

    def _leave_out(self, address: str, words: str) -> None:
        if address not in self._left_out:
            self._left_out[address] = f"The Dask worker at {address} {words}."
            log.warning("%s It is left out.", self._left_out[address])
