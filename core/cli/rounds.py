"""The rounds of a batch: photos refined from their starts, then those without one, or whose start failed, searched for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..batch.executors import Executor
from ..batch.find_one import joined
from ..batch.keys import BatchQuery, Refused, check_unchanged
from ..batch.records import LATER, TO_FIND, UNUSABLE
from ..batch.store import ResultStore
from ..cameras.training_world import Axes
from ..cameras.unplaced import wanted_to_dict
from ..geometry.camera import Camera
from ..locate import write_map
from ..pose.report_json import error_to_dict
from ..pose.settings import RefineSettings
from ..splats import read_splats
from ..support.scratch import ScratchFolder
from ..support.words import counted
from .console import message
from .maps import MapFlags, whole_map
from .progress import ProgressBar

CHANGED = "The photo or its mask was changed while the batch ran; run the batch again."


@dataclass(frozen=True)
class Rounds:
    """The work of a batch on the scan `scene`. `flags` None: photos are not searched for; `digest`: that of the scan which the
    store's keys stand for; `axes`: the world of the starts; `shared`: a name for a file that all workers can read, wherever
    they are.
    """

    scene: Path
    executor: Executor
    settings: RefineSettings
    flags: MapFlags | None
    digest: str
    axes: Axes = "auto"
    shared: Path | None = None

    def run(self, queries: Sequence[BatchQuery], store: ResultStore) -> None:
        """Puts a record of each query into the store that has none yet."""
        first: dict[str, Any] = {"scene": str(self.scene.resolve()), "digest": self.digest}
        first |= {"settings": {**asdict(self.settings), "threads": 1}, "axes": self.axes}
        for i, query in enumerate(queries):
            if isinstance(query.camera, Refused):
                store.put(i, error_to_dict(query.camera.given, query.camera.sentence))
        from_start = [i for i, q in enumerate(queries) if i not in store.records and isinstance(q.camera, Camera)]
        said = _Said()
        if from_start:
            work = _Round(queries, store, mark=self.flags is not None)
            work.run(first, self.executor, from_start, said)
        to_find = [i for i in range(len(queries)) if (gist := store.records.gist(i)) is None or gist.ending == LATER]
        if to_find and self.flags is not None:
            self._find(self.flags, first, to_find, _Round(queries, store), said)
        if said.dropped:
            message(f"Left out {counted(said.dropped, 'Gaussian')} of the scan, for a value that is NaN or infinite.")

    def _find(self, flags: MapFlags, first: dict[str, Any], to_find: list[int], work: _Round, said: _Said) -> None:
        """Makes sure that there is a map, and hands it to all workers as a file that nobody else writes to."""
        scene = read_splats(self.scene)
        check_unchanged(self.scene, self.digest)
        cache = flags.cache(scene)
        del scene
        made = whole_map(cache)
        del cache  # and the scan with it, which each of the workers is about to hold
        with self._map_file() as file:
            write_map(file, made)
            work.run({**first, "map": str(file), "key": made.key}, self.executor, to_find, said)

    @contextmanager
    def _map_file(self) -> Iterator[Path]:
        """A name for the map's file, which vanishes afterwards: among this machine's temporary files, or where other machines'
        workers read it too.
        """
        if self.executor.is_remote and self.shared is not None:
            try:
                yield self.shared
            finally:
                self.shared.unlink(missing_ok=True)
            return
        folder = ScratchFolder()
        try:
            yield folder.path / "map"
        finally:
            folder.remove()


@dataclass
class _Said:
    """What the workers told of the scan."""

    dropped: int = 0


@dataclass(frozen=True)
class _Round:
    """Jobs of one kind over a pool of workers. `mark`: failed ones are to be searched for later."""

    queries: Sequence[BatchQuery]
    store: ResultStore
    mark: bool = False

    def run(self, first: dict[str, Any], executor: Executor, indices: Sequence[int], said: _Said) -> None:
        jobs = [(i, self._job(self.queries[i])) for i in indices]
        label = "Finding" if "map" in first else "Refining"
        with executor.pool(first) as pool, ProgressBar(label) as bar:

            def started(left_out: int) -> None:
                said.dropped = left_out
                self._show(bar)

            for index, record in pool.run(jobs, self._lost, started):
                self.store.put(index, self._final(index, record))
                self._show(bar)

    def _job(self, query: BatchQuery) -> dict[str, Any]:
        assert not isinstance(query.camera, Refused), "its record is written already"
        mask = str(query.mask) if query.mask else None
        return {"camera": wanted_to_dict(query.camera), "photo": str(query.photo), "mask": mask}

    def _lost(self, index: int, words: str) -> dict[str, Any]:
        camera = self.queries[index].camera
        assert not isinstance(camera, Refused), "its record is written already"
        return error_to_dict(camera, f"The worker process ended on this photo ({words}).")

    def _final(self, index: int, record: dict[str, Any]) -> dict[str, Any]:
        """The record as it is kept: marked, or joined with the one that was; nobody knows which photo it is of when that has
        changed.
        """
        query = self.queries[index]
        if query.is_changed:
            assert not isinstance(query.camera, Refused), "its record is written already"
            return error_to_dict(query.camera, CHANGED)
        if self.mark:
            failed = record["verdict"] == "failed" and "error" not in record
            return {**record, TO_FIND: True} if failed else record
        before = self.store.records.get(index)
        if before is None:
            return record
        return joined({name: value for name, value in before.items() if name not in (TO_FIND, "key")}, record)

    def _show(self, bar: ProgressBar) -> None:
        endings = self.store.records.endings
        later, total = endings[LATER], len(self.queries)
        done = len(self.store.records) - later
        more = [f", {n} {what}" for n, what in ((endings[UNUSABLE], UNUSABLE), (later, LATER)) if n]
        bar.show(done / total, f"{done} of {total}, {endings['failed']} failed" + "".join(more))
