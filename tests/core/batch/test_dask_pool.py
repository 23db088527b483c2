"""A batch on a Dask cluster: whatever becomes of workers and scheduler, each photo gets one record, or stays undone."""

import itertools
import json
import logging
import os
import socket
import subprocess
import sys
import threading
import time
import warnings
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest
from children import DIES, WELL, WORKER, Scripted
from cli_place import FAST, Place, hurt_readers
from process_ends import alive, wait_for

from core.cli.main import main
from core.errors import RefineError

distributed = pytest.importorskip("distributed", reason="Dask is an extra: pip install distributed")

from core.batch.farm import dask_pool as module  # noqa: E402
from core.batch.farm import dask_worker  # noqa: E402

pytestmark = pytest.mark.process
REPO = Path(__file__).parents[3]
PATIENCE_S = 60
NO_SCAN = WORKER.replace("START", "requests.answer({'error': 'There is no scan at /there.'})")


class Starts:
    """Stands for `Child`: the k-th start runs the k-th script, or the last."""

    def __init__(self, *scripts):
        self.scripts, self.children, self.count = scripts, [], itertools.count()

    def __call__(self, *_):
        self.children.append(Scripted(self.scripts[min(next(self.count), len(self.scripts) - 1)]))
        return self.children[-1]


@contextmanager
def cluster(workers=2, port=0):
    """A scheduler with workers that are threads of this process, so that what a test puts in their place is theirs too."""
    options = {"processes": False, "protocol": "tcp", "dashboard_address": None, "silence_logs": logging.CRITICAL}
    with distributed.LocalCluster(n_workers=workers, threads_per_worker=1, scheduler_port=port, **options) as made:
        yield made


@pytest.fixture(scope="module")
def address():
    with cluster() as made:
        yield made.scheduler_address


def jobs(*what, wait=0.0):
    return [(i, {"do": do, "n": i, "wait": wait}) for i, do in enumerate(what)]


def lost(index, words):
    return {"n": index, "lost": words}


def run(monkeypatch, starts, work, address):
    """The records by index, and how many Gaussians the workers left out. No process may be left."""
    monkeypatch.setattr(dask_worker, "Child", starts)
    records, dropped = [], []
    try:
        with module.DaskPool({}, 1, address) as pool:
            records += pool.run(work, lost, dropped.append)
    finally:
        wait_for(lambda: all(child.exit_code() is not None for child in starts.children))
    assert len(records) == len(dict(records)), "one record each"
    return dict(records), dropped


def test_each_worker_opens_the_scan_once_and_all_tasks_are_done(monkeypatch, address):
    starts = Starts(WELL)
    records, dropped = run(monkeypatch, starts, jobs(*["go"] * 12, wait=0.1), address)
    assert {i: record["n"] for i, record in records.items()} == {i: i for i in range(12)}
    assert dropped == [5, 5]
    assert len(starts.children) == 2


def test_no_more_is_handed_out_than_the_workers_need(monkeypatch, address):
    most, hand_out = [], module.DaskPool._hand_out
    monkeypatch.setattr(module.DaskPool, "_hand_out", lambda self, work: (hand_out(self, work), most.append(len(work.flying))))
    records, _ = run(monkeypatch, Starts(WELL), jobs(*["go"] * 30), address)
    assert len(records) == 30
    assert 2 <= max(most) <= module.AHEAD * 2


def test_a_photo_that_ends_its_process_costs_that_photo(monkeypatch, address):
    records, _ = run(monkeypatch, Starts(WELL), jobs("go", "die", "go", "go"), address)
    assert [i for i in records if "lost" in records[i]] == [1]
    assert records[1]["lost"] == "exit code 7"


def test_a_worker_without_the_scan_is_left_out_with_one_sentence(monkeypatch, address, caplog):
    records, _ = run(monkeypatch, Starts(NO_SCAN, WELL), jobs(*["go"] * 8, wait=0.1), address)
    assert sorted(records) == list(range(8)) and not any("lost" in record for record in records.values())
    said = [r.getMessage() for r in caplog.records if r.name == module.__name__]
    assert len(said) == 1
    assert "cannot open the scan: There is no scan at /there. It is left out." in said[0]


@pytest.mark.parametrize(
    ("script", "words"),
    [(NO_SCAN, "cannot open the scan: There is no scan at /there"), (DIES, "lost its process while it read the scan")],
)
def test_where_no_worker_can_do_a_photo_that_is_one_error(monkeypatch, address, script, words):
    monkeypatch.setattr(module, "GRACE_S", 0.2)
    with pytest.raises(RefineError, match=words) as caught:
        run(monkeypatch, Starts(script), jobs("go", "go"), address)
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


def test_workers_with_other_versions_are_refused(monkeypatch, address):
    monkeypatch.setattr(module, "GRACE_S", 0.2)
    here = dask_worker.versions()
    monkeypatch.setattr(dask_worker, "versions", lambda: here | {"OpenCV": "4.0.0"})
    starts = Starts(WELL)
    with pytest.raises(RefineError, match=rf"has OpenCV 4\.0\.0 instead of {here['OpenCV']}, and its answers may differ"):
        run(monkeypatch, starts, jobs("go"), address)
    assert not starts.children


def test_a_scheduler_that_is_nowhere_is_one_sentence(monkeypatch):
    monkeypatch.setattr(module, "CONNECT_S", 0.5)
    with pytest.raises(RefineError, match=r"^No Dask scheduler answers at 'tcp://127.0.0.1:9' \(.*\); start one with"):
        run(monkeypatch, Starts(WELL), jobs("go"), "tcp://127.0.0.1:9")


@pytest.mark.parametrize("wrong", ["", "head", "htp://head:8786", "tcp://head", "tcp://head:port"])
def test_an_address_that_is_none_is_one_sentence_at_once(monkeypatch, wrong):
    began = time.monotonic()
    with pytest.raises(RefineError, match=r"^No Dask scheduler answers at '.*' \(that is no address; give one such as "):
        run(monkeypatch, Starts(WELL), jobs("go"), wrong)
    assert time.monotonic() - began < module.CONNECT_S / 2


@pytest.mark.parametrize("answer", [None, b"HTTP/1.0 400 Bad Request\r\n\r\n" + 99 * b"x", b"\x08" + 7 * b"\0" + 99 * b"hello"])
def test_what_listens_and_is_no_scheduler_is_one_sentence(monkeypatch, answer):
    """A program that says nothing, a web server such as the scheduler's dashboard, and one that says anything."""
    monkeypatch.setattr(module, "CONNECT_S", 0.5)
    open_ones = []

    def serve(server):
        with suppress(OSError):  # the test's end
            while True:
                open_ones.append(server.accept()[0])
                if answer is not None:
                    open_ones[-1].sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        with pytest.raises(RefineError, match=r"what listens there does not answer as a scheduler, whose port is 8786"):
            run(monkeypatch, Starts(WELL), jobs("go"), f"tcp://127.0.0.1:{server.getsockname()[1]}")
    for one in open_ones:
        one.close()


def test_a_cluster_is_started_here_without_a_warning_also_beside_another():
    with ExitStack() as held, warnings.catch_warnings():
        with suppress(OSError):  # somebody else has it
            held.enter_context(socket.create_server(("127.0.0.1", 8787)))
        warnings.simplefilter("error")
        with module.DaskPool({}, 1, None):
            pass


def test_the_address_of_a_worker_is_one_sentence(monkeypatch):
    with cluster(1) as made, pytest.raises(RefineError, match=r"\(what listens there is a worker\)"):
        run(monkeypatch, Starts(WELL), jobs("go"), made.workers[0].address)


def test_a_scheduler_that_ends_and_comes_back_loses_nothing(monkeypatch, caplog):
    monkeypatch.setattr(module, "CONNECT_S", 1.0)
    monkeypatch.setattr(module, "LOOK_S", 0.1)
    records, errors, started = {}, [], threading.Event()
    with cluster(1) as first:
        address = first.scheduler_address
        monkeypatch.setattr(dask_worker, "Child", Starts(WELL))

        def batch():
            try:
                with module.DaskPool({}, 1, address) as pool:
                    for index, record in pool.run(jobs(*["go"] * 10, wait=0.2), lost, lambda n: None):
                        assert index not in records
                        records[index] = record
                        started.set()
            except Exception as error:  # noqa: BLE001
                errors.append(error)

        thread = threading.Thread(target=batch, daemon=True)
        thread.start()
        assert started.wait(PATIENCE_S)
    wait_for(lambda: "is gone; waiting for it. What is finished is kept." in caplog.text, PATIENCE_S)
    time.sleep(1.5)  # longer than Dask's own client tries
    with cluster(1, int(address.rpartition(":")[2])):
        thread.join(PATIENCE_S)
    assert not thread.is_alive() and not errors
    assert sorted(records) == list(range(10)) and not any("lost" in record for record in records.values())
    assert caplog.text.count("is gone") == 1


def test_a_batch_that_is_left_in_the_middle_leaves_no_process_and_no_task(monkeypatch, address):
    starts = Starts(WELL)
    monkeypatch.setattr(dask_worker, "Child", starts)
    with pytest.raises(KeyboardInterrupt), module.DaskPool({}, 1, address) as pool:
        for _ in pool.run(jobs(*["go"] * 8, wait=0.3), lost, lambda n: None):
            raise KeyboardInterrupt
    wait_for(lambda: all(child.exit_code() is not None for child in starts.children))
    with distributed.Client(address, set_as_default=False) as client:
        wait_for(lambda: not any(client.processing().values()))


def test_a_killed_worker_costs_nothing_and_the_answers_are_those_of_one_machine(tmp_path, monkeypatch):
    place = Place(tmp_path, photos=1, gaussians=6000)
    frame = json.loads(Path(place.json(tmp_path / "s.json", place.starts)).read_text())
    (tmp_path / "photo_slow.png").write_bytes((tmp_path / "photo_0.png").read_bytes())
    queries = tmp_path / "q.json"
    queries.write_text(json.dumps({**frame, "file": "photo_slow.png"}))
    argv = ["batch", str(place.scene), str(queries), "--workers", "1", "--no-locate", *FAST]
    assert main([*argv, "--out", str(tmp_path / "local.json")]) == 0
    hook = tmp_path / "hook"
    hurt_readers(hook, monkeypatch)
    (hook / "hang").touch()
    path = os.pathsep.join([str(hook), str(REPO), *filter(None, [os.environ.get("PYTHONPATH")])])
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    bare = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    told = tmp_path / "scheduler.json"
    processes = [subprocess.Popen([*dask, "--scheduler-file", told], cwd=tmp_path, env=bare, **quiet)]  # it has no engine
    try:
        wait_for(lambda: told.exists() and told.read_text().endswith("}"), PATIENCE_S)
        address = json.loads(told.read_text())["address"]
        worker = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
        ]
        options = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": path}, **quiet}
        processes.append(subprocess.Popen(worker, **options))
        ends, more = [], ["--executor", "dask", "--scheduler", address, "--out", str(tmp_path / "dask.json")]
        thread = threading.Thread(target=lambda: ends.append(main([*argv, *more])), daemon=True)
        thread.start()
        wait_for(lambda: list(hook.glob("*.pid")), PATIENCE_S)  # the photo is being read, or will be at once
        processes[1].kill()
        (hook / "hang").unlink()
        processes.append(subprocess.Popen(worker, **options))
        thread.join(PATIENCE_S)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert ends == [0]
    wait_for(lambda: not any(alive(int(pid.stem)) for pid in hook.glob("*.pid")))
    local, dask = (json.loads((tmp_path / name).read_text())["frames"] for name in ("local.json", "dask.json"))
    timeless = [[{k: v for k, v in f.items() if k not in ("seconds", "sum")} for f in frames] for frames in (local, dask)]
    assert timeless[0] == timeless[1]
