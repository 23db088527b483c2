"""Where the photos of a batch are done: by processes of this machine, or by the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from ..errors import UsageError
from ..processes.pool import Lost, Pool, Task

EXECUTORS = ("local", "dask")
PACKAGE = "core"


class TaskPool(Protocol):
    """What `processes.pool.Pool` does."""

    def run(self, tasks: Sequence[Task], lost: Lost, started: Callable[[int], None]) -> Iterator[Task]: ...


@dataclass(frozen=True)
class Executor:
    """`kind`, of EXECUTORS; `workers`: how many processes are started here; `scheduler`: the address of a Dask scheduler, whose
    workers are used instead.
    """

    workers: int
    kind: str = EXECUTORS[0]
    scheduler: str | None = None

    @property
    def is_remote(self) -> bool:
        """Whether workers may be on other machines, and share no folder for temporary files with this one."""
        return self.scheduler is not None

    def check(self) -> None:
        """Raises UsageError when it cannot be used here, before any work."""
        if self.kind == EXECUTORS[0]:
            if self.scheduler is not None:
                raise UsageError("--scheduler goes with --executor dask; give both, or neither.")
            return
        if (__package__ or "").split(".")[0] != PACKAGE:  # the workers look for our modules by the name that they have here
            raise UsageError("--executor dask runs under plain Python ('python -m core batch'); in Blender take --shard.")
        self._dask_pool({})

    def pool(self, first: dict[str, Any]) -> AbstractContextManager[TaskPool]:
        """Workers that begin with the message `first`, see `batch.worker`."""
        return Pool(first, self.workers) if self.kind == EXECUTORS[0] else self._dask_pool(first)

    def _dask_pool(self, first: dict[str, Any]) -> AbstractContextManager[TaskPool]:
        try:
            from .farm.dask_pool import DaskPool
        except ModuleNotFoundError as error:
            raise UsageError(
                f"--executor dask needs the package distributed ('{error.name}' is not installed); install it with "
                "'pip install distributed', here and on the workers."
            ) from None
        return DaskPool(first, self.workers, self.scheduler)
