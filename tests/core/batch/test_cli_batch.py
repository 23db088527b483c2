"""Batches survive what happens to long work: bad photos, dying workers, Ctrl-C, a second run."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_place import FAST, Place, hurt_readers

from core.batch.store import ResultStore
from core.cameras.files import camera_from_dict
from core.cli.main import main
from core.geometry.camera import pose_error
from core.processes import pool
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene

PATIENCE_S = 120


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return Place(tmp_path_factory.mktemp("place"))


def queries(place, *files):
    """A queries file: camera k starts for files[k], which need not exist."""
    starts = [replace(place.starts[i % len(place.starts)], file=name) for i, name in enumerate(files)]
    return place.json(place.folder / f"queries_{len(files)}.json", starts)


def batch(place, file, out, *more):
    return main(["batch", str(place.scene), file, "--out", str(out), "--workers", "2", *FAST, *more])


def frames(out):
    return json.loads(Path(out).read_text())["frames"]


def journalled(out):
    """The records of a batch that runs, or was killed, in the order of their end."""
    file = out.with_name(out.name + ".journal")
    lines = file.read_text().splitlines(keepends=True)[1:] if file.exists() else []
    return [json.loads(line) for line in lines if line.endswith("\n")]


def alive(pid):
    """Whether a process runs; one that ended and waits to be collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_results_in_order_one_bad_photo_alone_and_a_second_run_that_resumes(place, tmp_path, capsys, monkeypatch):
    (place.folder / "broken.jpg").write_text("no photo")
    file = queries(place, "photo_0.png", "broken.jpg", "photo_2.png", "missing.png", "photo_1.png")
    cameras = [place.starts[0], None, place.starts[2], None, place.starts[4 % 3]]
    out = tmp_path / "deep" / "results.json"
    assert batch(place, file, out) == 3
    first = frames(out)
    assert [f["file"] for f in first] == ["photo_0.png", "broken.jpg", "photo_2.png", "missing.png", "photo_1.png"]
    captured = capsys.readouterr()
    assert " 0 failed, 2 not usable; results in" in captured.out
    assert "'broken.jpg' could not be used: The photo 'broken.jpg' cannot be decoded" in captured.err
    assert "'missing.png' could not be used: There is no photo at" in captured.err
    for k, words in ((1, "cannot be decoded"), (3, "There is no photo at")):
        assert first[k]["verdict"] == "failed"
        assert words in first[k]["reasons"][0]
        np.testing.assert_allclose(first[k]["t"], place.starts[k % 3].pose.t)
    for k in (0, 2):
        assert first[k]["verdict"] != "failed"
        truth = place.truths[k].pose
        assert pose_error(camera_from_dict(first[k]).pose, truth)[0] < 0.3 * pose_error(cameras[k].pose, truth)[0]

    (place.folder / "broken.jpg").write_bytes((place.folder / "photo_1.png").read_bytes())  # the user mends one photo
    hurt_readers(tmp_path / "hook", monkeypatch)  # counts the workers of the second run
    assert batch(place, file, out) == 3
    second = frames(out)
    assert "3 of 5 photos were finished before" in capsys.readouterr().err
    assert [second[k] for k in (0, 2, 4)] == [first[k] for k in (0, 2, 4)]  # to the last digit, seconds included
    assert second[1]["verdict"] != "failed"
    assert second[3] == first[3]


def test_a_finished_batch_starts_no_worker(place, tmp_path, monkeypatch):
    file, out = queries(place, "photo_0.png", "photo_1.png"), tmp_path / "r.json"
    assert batch(place, file, out) == 0
    before = out.read_text()
    hurt_readers(tmp_path / "hook", monkeypatch)
    assert batch(place, file, out) == 0
    assert out.read_text() == before
    assert not list((tmp_path / "hook").glob("*.pid"))
    assert batch(place, file, out, "--seed", "5") == 0  # other options: everything anew
    assert list((tmp_path / "hook").glob("*.pid"))


def refined_anew(place, file, out, hook, scene=None):
    """How many workers a further run starts: none where nothing has changed."""
    for pid in hook.glob("*.pid"):
        pid.unlink()
    argv = ["batch", str(scene or place.scene), file, "--out", str(out), "--workers", "1", *FAST]
    assert main(argv) == 0
    return len(list(hook.glob("*.pid")))


def test_answers_of_another_photo_or_scan_of_the_same_name_and_size_are_not_handed_out(place, tmp_path, monkeypatch):
    hook, out, scene, photo = tmp_path / "hook", tmp_path / "r.json", tmp_path / "scene.ply", place.folder / "exchanged.png"
    hurt_readers(hook, monkeypatch)
    scene.write_bytes(place.scene.read_bytes())
    photo.write_bytes((place.folder / "photo_0.png").read_bytes())
    file = queries(place, "exchanged.png")
    assert refined_anew(place, file, out, hook, scene) == 1
    assert refined_anew(place, file, out, hook, scene) == 0
    first = frames(out)
    write_ply(scene, make_scene(5, 12_000))  # another training with a cap on its Gaussians
    assert scene.stat().st_size == place.scene.stat().st_size
    assert main(["batch", str(scene), file, "--out", str(out), "--workers", "1", *FAST]) in (0, 3)
    assert frames(out)[0]["t"] != first[0]["t"]
    assert frames(out.with_name("r.json.old")) == first
    scene.write_bytes(place.scene.read_bytes())
    assert refined_anew(place, file, out, hook, scene) == 1
    photo.write_bytes(b"".join([photo.read_bytes(), b"x"]))  # pixels stay, and so does the pose
    assert refined_anew(place, file, out, hook, scene) == 1
    assert frames(out)[0]["t"] == first[0]["t"]


def test_a_batch_refuses_the_results_file_of_another_that_runs(place, tmp_path, capsys):
    file, out = queries(place, "photo_0.png"), tmp_path / "r.json"
    with ResultStore(out, ["some key"]):
        assert batch(place, file, out) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("Another batch is writing to") and captured.err.count("\n") == 1
    assert not out.exists()


def test_a_system_that_gives_one_process_less_costs_no_photo(place, tmp_path, monkeypatch, caplog):
    """The second worker cannot be started; on earlier code the batch never came to its end."""
    start, started = pool.Child, []

    def starts(*args):
        started.append(args)
        if len(started) == 2:
            raise OSError(11, "Resource temporarily unavailable")
        return start(*args)

    monkeypatch.setattr(pool, "Child", starts)
    file, codes = queries(place, "photo_0.png", "photo_1.png", "photo_2.png"), []
    thread = threading.Thread(target=lambda: codes.append(batch(place, file, tmp_path / "r.json")), daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert codes == [0]
    assert [f["file"] for f in frames(tmp_path / "r.json")] == ["photo_0.png", "photo_1.png", "photo_2.png"]
    assert "cannot be started (Resource temporarily unavailable)" in caplog.text


def test_a_worker_that_dies_costs_one_photo(place, tmp_path, monkeypatch):
    hurt_readers(tmp_path / "hook", monkeypatch)
    (place.folder / "killer.png").write_bytes((place.folder / "photo_1.png").read_bytes())
    file = queries(place, "photo_0.png", "killer.png", "photo_2.png")
    assert batch(place, file, tmp_path / "r.json", "--workers", "1") == 3
    records = frames(tmp_path / "r.json")
    assert [r["verdict"] == "failed" for r in records] == [False, True, False]
    assert "worker process ended on this photo" in records[1]["reasons"][0]
    pids = [int(p.stem) for p in (tmp_path / "hook").glob("*.pid")]
    assert len(pids) == 2  # the dead one was replaced
    assert not any(alive(pid) for pid in pids)


def test_workers_agree_with_a_single_refinement(place, tmp_path):
    file, cam = queries(place, "photo_0.png"), place.json(tmp_path / "cam.json", place.starts[:1])
    assert batch(place, file, tmp_path / "r.json") == 0
    alone = [
        "refine",
        str(place.scene),
        str(place.folder / "photo_0.png"),
        "--camera",
        cam,
        "--out",
        str(tmp_path / "one.json"),
    ]
    assert main([*alone, *FAST, "--threads", "1"]) == 0
    a, b = frames(tmp_path / "r.json")[0], json.loads((tmp_path / "one.json").read_text())
    np.testing.assert_allclose(a["t"], b["t"], atol=1e-6)


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is a signal to the process group here")
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_interruption_loses_nothing_that_was_finished(place, tmp_path, monkeypatch, end):
    hook = tmp_path / "hook"
    hurt_readers(hook, monkeypatch)
    (hook / "hang").touch()
    (place.folder / "slow.png").write_bytes((place.folder / "photo_1.png").read_bytes())
    file, out = queries(place, "photo_0.png", "slow.png", "photo_2.png"), tmp_path / "r.json"
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background's children have it ignored otherwise
    process = subprocess.Popen(
        [sys.executable, "-m", "core", "batch", str(place.scene), file, "--out", str(out), "--workers", "2", *FAST],
        cwd=Path(__file__).parents[3],
        env={**os.environ, "PYTHONPATH": str(hook)},
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    signal.signal(signal.SIGINT, handler)
    give_up = time.monotonic() + PATIENCE_S
    while len(journalled(out)) < 2:
        assert process.poll() is None and time.monotonic() < give_up
        time.sleep(0.01)
    finished = sorted(journalled(out), key=lambda record: record["file"])
    if end == signal.SIGINT:
        os.killpg(process.pid, end)  # as a terminal does it: to the whole group
    else:
        process.kill()
    error = process.communicate(timeout=PATIENCE_S)[1]
    assert process.returncode == (130 if end == signal.SIGINT else -signal.SIGKILL)
    assert "Traceback" not in error
    if end == signal.SIGINT:
        assert f"2 of 3 photos finished, in '{out}'. The same command goes on" in error
    (hook / "hang").unlink()
    while any(alive(int(p.stem)) for p in hook.glob("*.pid")):  # also after a kill: workers end with their input
        assert time.monotonic() < give_up
        time.sleep(0.05)
    if end == signal.SIGINT:
        assert frames(out) == finished
        assert not journalled(out)
    assert batch(place, file, out) == 0
    again = frames(out)
    assert [again[0], again[2]] == finished
    assert again[1]["file"] == "slow.png"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["hook", "r.json"]
    assert not [p for p in tmp_path.iterdir() if p.suffix == ".part"]


def test_scene_that_breaks_in_the_worker_is_one_sentence(place, tmp_path, capsys):
    cut = tmp_path / "cut.ply"
    cut.write_bytes(place.scene.read_bytes()[:-1000])
    assert main(["batch", str(cut), queries(place, "photo_0.png"), "--out", str(tmp_path / "r.json")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "The file is cut off" in error
    assert not (tmp_path / "r.json").exists()


def test_a_query_without_a_photo_is_named_and_fails_alone(place, tmp_path, capsys):
    out = tmp_path / "r.json"
    assert batch(place, queries(place, "photo_0.png", ""), out, "--workers", "1") == 3
    assert "Camera 2 of 'queries_2.json' names no photo" in capsys.readouterr().err
    assert [("error" in frame, frame["t"] is None) for frame in frames(out)] == [(False, False), (True, False)]
    assert batch(place, queries(place, ""), tmp_path / "none.json") == 2  # there is nothing to be done
    assert "names no photo" in capsys.readouterr().err
