"""A batch's workers: whatever becomes of one, the batch comes to an end, with as many as there are."""

import logging
import threading

import pytest
from children import DIES, WELL, WORKER, Scripted

from core.errors import RefineError, SplatFormatError
from core.processes import pool as module
from core.processes.pool import Pool

PATIENCE_S = 90
LATE = WORKER.replace("START", "time.sleep(3); requests.answer({'error': 'Too many open files.'})")
NO_SCAN = WORKER.replace("START", "requests.answer({'error': 'The scan is none.'})")


class Starts:
    """Stands for `Child`: the k-th start runs the k-th script, or the last; an OSError among them is raised."""

    def __init__(self, *scripts):
        self.scripts, self.children, self.count = scripts, [], 0
        self._lock = threading.Lock()

    def __call__(self, *_):
        with self._lock:
            script = self.scripts[min(self.count, len(self.scripts) - 1)]
            self.count += 1
        if isinstance(script, Exception):
            raise script
        self.children.append(Scripted(script))
        return self.children[-1]


def jobs(*what, wait=0.0):
    return [(i, {"do": do, "n": i, "wait": wait}) for i, do in enumerate(what)]


def lost(index, words):
    return {"n": index, "lost": words}


def run(monkeypatch, starts, work, workers=2, lost=lost):
    """The records by index, or the error; fails when the batch does not end. No process may be left."""
    monkeypatch.setattr(module, "Child", starts)
    records, dropped, errors = {}, [], []

    def batch():
        try:
            with Pool({}, workers) as pool:
                records.update(pool.run(work, lost, dropped.append))
        except Exception as error:  # noqa: BLE001
            errors.append(error)

    thread = threading.Thread(target=batch, daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert not thread.is_alive(), "the batch hangs"
    assert all(child.exit_code() is not None for child in starts.children)
    return records, dropped, errors


def test_all_jobs_are_done_by_as_many_workers_as_are_asked_for(monkeypatch):
    starts = Starts(WELL)
    records, dropped, errors = run(monkeypatch, starts, jobs(*["go"] * 12, wait=1.5), workers=3)
    assert not errors
    assert sorted(records) == list(range(12)) and all(records[i]["n"] == i for i in records)
    assert dropped == [5] * 3
    assert starts.count == 3


@pytest.mark.parametrize("bad", [OSError(11, "Resource temporarily unavailable"), DIES, LATE])
def test_a_worker_that_cannot_start_lowers_their_number(monkeypatch, caplog, bad):
    """Also one that cannot read the scan, when another has: that is no fault of the scan."""
    with caplog.at_level(logging.WARNING):
        records, _, errors = run(monkeypatch, Starts(WELL, bad), jobs(*["go"] * 6, wait=0.8))
    assert not errors
    assert sorted(records) == list(range(6))
    assert not any("lost" in r for r in records.values())
    assert "The batch goes on with 1." in caplog.text


@pytest.mark.parametrize(
    ("bad", "kind", "words"),
    [
        (OSError(11, "Resource temporarily unavailable"), RefineError, "cannot be started (Resource temporarily unavailable)"),
        (DIES, RefineError, "ended while it read the scan (exit code 3)"),
        (NO_SCAN, SplatFormatError, "The scan is none."),
    ],
)
def test_when_none_can_start_that_is_one_error(monkeypatch, bad, kind, words):
    records, _, (error,) = run(monkeypatch, Starts(bad), jobs("go", "go", "go"), workers=3)
    assert isinstance(error, kind)
    assert words in str(error)
    assert not records


@pytest.mark.parametrize("end", ["die", "cut"])
def test_a_worker_that_ends_costs_its_job_and_is_replaced(monkeypatch, end):
    starts = Starts(WELL)
    records, _, errors = run(monkeypatch, starts, jobs("go", end, "go", "go"), workers=1)
    assert not errors
    assert [i for i in records if "lost" in records[i]] == [1]
    assert {"die": "exit code 7", "cut": "no message"}[end] in records[1]["lost"]
    assert starts.count == 2


def test_one_that_cannot_be_replaced_leaves_the_rest_to_the_others(monkeypatch):
    starts = Starts(WELL, WELL, OSError(12, "Cannot allocate memory"))
    records, _, errors = run(monkeypatch, starts, jobs("die", *["go"] * 30))
    assert not errors
    assert [i for i in records if "lost" in records[i]] == [0]
    assert len(records) == 31


def test_a_job_that_takes_for_ever_is_given_up(monkeypatch):
    monkeypatch.setattr(module, "TASK_LIMIT_S", 2.0)
    records, _, errors = run(monkeypatch, Starts(WELL), jobs("hang", "go"), workers=1)
    assert not errors
    assert records[0]["lost"] == "no answer in 2 s"
    assert records[1]["n"] == 1


def test_whatever_a_thread_breaks_down_of_is_heard(monkeypatch):
    def broken(index, words):
        raise ZeroDivisionError("a fault of ours")

    _, _, (error,) = run(monkeypatch, Starts(WELL), jobs("die", "go"), workers=1, lost=broken)
    assert isinstance(error, ZeroDivisionError)


def test_leaving_early_ends_jobs_and_workers_that_are_starting(monkeypatch):
    starts = Starts(WELL, WORKER.replace("START", "time.sleep(600)"))
    monkeypatch.setattr(module, "Child", starts)
    done = []

    def leave():
        with Pool({}, 2) as pool:
            for item in pool.run(jobs("go", "hang", "hang"), lost, lambda n: None):
                done.append(item)
                return

    thread = threading.Thread(target=leave, daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert len(done) == 1
    assert all(child.exit_code() is not None for child in starts.children)
