"""The results file of a batch: always in order, always whole on disk, and as much of it taken up again as is sound."""

import json
import os
import subprocess
import sys
import tracemalloc
from itertools import pairwise
from pathlib import Path

import pytest

from core.batch import store as store_module
from core.batch.keys import key_of
from core.batch.store import ResultsError, ResultStore
from core.support.sealed import sealed

pytestmark = pytest.mark.unit

KEYS = [key_of("photo", i) for i in range(4)]


def record(i, **more):
    return {
        "file": f"{i}.jpg",
        "verdict": "check",
        "reasons": ['Words with "quotes", {braces} and ümlauts.'],
        "t": [i, 0.1, 1],
    } | more


def stored(i, **more):
    return sealed(record(i, **more) | {"key": KEYS[i]})


@pytest.fixture
def path(tmp_path):
    return tmp_path / "deep" / "results.json"


def journal(path):
    return path.with_name("results.json.journal")


def killed(store):
    """What is left of a batch that is killed: its files as they are, and no lock."""
    os.close(store._handle)


def left_by_a_killed_run(path, indices):
    """A journal of new answers for these photos, beside the results of before."""
    store = ResultStore(path, KEYS)
    store.__enter__()
    for i in indices:
        store.put(i, record(i, t=[i, 9, 9]))
    killed(store)


@pytest.fixture
def each_synced(monkeypatch):
    """Every record is told to the disk by itself, as where photos take seconds."""
    monkeypatch.setattr(store_module, "SYNC_S", 0.0)


@pytest.fixture
def full(path):
    with ResultStore(path, KEYS) as store:
        for i in (2, 0, 3, 1):  # workers finish in any order
            store.put(i, record(i))
    return path


def resumed(path, keys=KEYS):
    with ResultStore(path, keys) as store:
        return store.records


def frames(path):
    return json.loads(path.read_text())["frames"]


def test_records_stand_in_the_order_of_the_queries(full):
    assert [f["file"] for f in frames(full)] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]
    assert [f["key"] for f in frames(full)] == KEYS
    assert os.listdir(full.parent) == ["results.json"]


def test_every_record_is_on_disk_when_put_returns(path):
    with ResultStore(path, KEYS) as store:
        for done, i in enumerate((3, 1), 1):
            store.put(i, record(i))
            lines = journal(path).read_text().splitlines()[1:]
            assert len(lines) == done
            assert json.loads(lines[-1]) == stored(i)
    assert [f["file"] for f in frames(path)] == ["1.jpg", "3.jpg"]


def test_what_is_written_for_a_record_does_not_grow_with_their_number(path, monkeypatch, each_synced):
    written = []
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: written.append(os.fstat(handle).st_size) or fsync(handle))
    keys = [key_of(i) for i in range(200)]
    with ResultStore(path, keys) as store:
        for i in range(200):
            store.put(i, record(0))
        ends = list(written)
    assert len(ends) == 200
    steps = {b - a for a, b in pairwise(ends)}
    assert steps == {len(json.dumps(stored(0)).encode()) + 1}
    assert len(frames(path)) == 200


def test_records_that_come_fast_are_told_to_the_disk_together(path, monkeypatch):
    synced, now = [], [100.0]
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(round(now[0], 1)) or fsync(handle))
    monkeypatch.setattr(store_module.time, "monotonic", lambda: now[0])
    with ResultStore(path, [key_of(i) for i in range(40)]) as store:
        for i in range(40):
            now[0] = 100.0 + 0.1 * i if i < 20 else 200.0 + i
            store.put(i, record(i))
    assert synced[:4] == [100.0, 100.5, 101.0, 101.5]
    assert synced[4:24] == [200.0 + i for i in range(20, 40)]


def test_ten_times_the_photos_cost_ten_times_the_bytes_and_no_more_memory(path):
    """Records of 4 KB: of two thousand, a store that held them would hold 8 MB of text alone."""
    long = "x" * 4000
    keys = [key_of(i) for i in range(2000)]
    tracemalloc.start()
    sizes = {}
    try:
        with ResultStore(path, keys) as store:
            for i in range(2000):
                store.put(i, record(i, details=[long]))
                if i + 1 in (200, 2000):
                    sizes[i + 1] = (journal(path).stat().st_size, tracemalloc.get_traced_memory()[0])
            peak_running = tracemalloc.get_traced_memory()[1]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 9.9 < sizes[2000][0] / sizes[200][0] < 10.1
    assert sizes[2000][1] - sizes[200][1] < 2e6
    assert peak < peak_running + 1e6, "the results file is written record by record"
    assert store.records[1999]["details"] == [long] and store.records.endings == {"check": 2000}
    assert len(resumed(path, keys)) == 2000


def test_a_line_that_was_cut_short_is_left_out_with_a_word(full, caplog):
    left_by_a_killed_run(full, (1, 2))
    data = journal(full).read_bytes()
    journal(full).write_bytes(data[:-10])
    full.unlink()
    assert sorted(resumed(full)) == [1]
    assert "The last line of" in caplog.text and "its photo is done again" in caplog.text
    assert frames(full)[0]["t"] == [1, 9, 9]


def test_damaged_lines_amid_a_journal_cost_their_own_photos(full, caplog):
    left_by_a_killed_run(full, range(4))
    lines = journal(full).read_bytes().splitlines(keepends=True)
    lines[2], lines[3] = b"\0" * (len(lines[2]) - 1) + b"\n", lines[3].replace(b":", b"\xff", 1)
    journal(full).write_bytes(b"".join(lines))
    full.unlink()
    assert sorted(resumed(full)) == [0, 3]
    assert "2 lines of" in caplog.text


def test_results_that_another_program_wrote_anew_are_taken_up(full):
    before = frames(full)
    for text in (json.dumps({"frames": before}, indent=2), '{"frames": [\n' + json.dumps(before, indent=1)[1:] + "}"):
        full.write_text(text)
        assert len(resumed(full)) == 4


def test_a_second_run_takes_up_what_was_finished(full):
    found = resumed(full)
    assert {i: r["t"] for i, r in found.items()} == {i: [i, 0.1, 1] for i in range(4)}


def test_a_killed_run_is_taken_up_from_its_journal_wherever_it_was_cut(full):
    left_by_a_killed_run(full, (1, 2))
    data = journal(full).read_bytes()
    for cut in range(0, len(data) + 1, 5):
        journal(full).write_bytes(data[:cut])
        full.unlink(missing_ok=True)
        whole = max(0, data[:cut].count(b"\n") - 1)
        found = resumed(full)
        assert len(found) in (whole, whole + 1), cut  # one more where only the line's end was cut off
        assert all(found[i]["t"] == [i, 9, 9] for i in found)
        assert not journal(full).exists()
        assert len(frames(full)) == len(found) if cut else not full.exists()


def test_the_journal_wins_over_the_results(full):
    store = ResultStore(full, KEYS)
    store.__enter__()
    store.put(1, record(1, t=[7, 7, 7]))
    killed(store)
    assert [r["t"] for _, r in sorted(resumed(full).items())] == [[0, 0.1, 1], [7, 7, 7], [2, 0.1, 1], [3, 0.1, 1]]
    assert [f["t"] for f in frames(full)] == [[0, 0.1, 1], [7, 7, 7], [2, 0.1, 1], [3, 0.1, 1]]


def test_two_batches_on_one_file_refuse_each_other(path, tmp_path):
    other = tmp_path / "link.json"
    path.parent.mkdir()
    other.symlink_to(path)  # however it is spelt
    with ResultStore(path, KEYS) as store:
        store.put(0, record(0))
        for spelt in (path, other, path.parent / "x" / ".." / "results.json"):
            with pytest.raises(ResultsError, match=r"Another batch is writing to .*give another --out\.$"):
                ResultStore(spelt, KEYS).__enter__()
        store.put(1, record(1))
    assert sorted(resumed(other)) == [0, 1]
    assert other.is_symlink()


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL")
def test_the_lock_of_a_killed_batch_does_not_block(path):
    code = f"""
import pathlib, sys, time
from core.batch.store import ResultStore
store = ResultStore(pathlib.Path({str(path)!r}), {KEYS!r}).__enter__()
store.put(2, {record(2)!r})
print("ready", flush=True)
time.sleep(600)
"""
    process = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[3], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"ready\n"
    with pytest.raises(ResultsError, match="Another batch"):
        ResultStore(path, KEYS).__enter__()
    process.kill()
    process.communicate()
    assert sorted(resumed(path)) == [2]
    assert os.listdir(path.parent) == ["results.json"]


def test_queries_may_be_added_removed_and_moved(full):
    found = resumed(full, [KEYS[3], key_of("new"), KEYS[0]])
    assert {i: r["file"] for i, r in found.items()} == {0: "3.jpg", 2: "0.jpg"}


def test_results_of_other_options_are_kept_aside(full, caplog):
    before = frames(full)
    with ResultStore(full, [key_of("new")]) as store:
        store.put(0, record(9))
    assert [f["file"] for f in frames(full)] == ["9.jpg"]
    assert frames(full.with_name("results.json.old")) == before
    assert "4 results of other photos or options" in caplog.text


def test_photos_that_could_not_be_tried_are_tried_again(full):
    with ResultStore(full, KEYS) as store:
        store.put(1, record(1, verdict="failed", error="There is no photo."))
        store.put(2, record(2, verdict="failed"))  # tried, and not found: a second try with the same seed would end the same
    assert sorted(resumed(full)) == [0, 2, 3]


def test_a_file_cut_short_anywhere_loses_only_the_record_it_was_cut_in(full):
    data = full.read_bytes()
    head = data.index(b"\n") + 1
    for cut in range(head, len(data), 7):
        full.write_bytes(data[:cut])
        whole = data[head:cut].count(b"\n")
        found = resumed(full)
        assert len(found) in (whole, whole + 1), cut  # one more where only the line's end was cut off
        assert all(r == stored(i) for i, r in found.items())


def test_a_cut_file_is_mended_by_the_next_run(full):
    full.write_bytes(full.read_bytes()[:-90])
    with ResultStore(full, KEYS) as store:
        assert len(store.records) == 3
        store.put(3, record(3))
    assert len(frames(full)) == 4


def test_a_changed_digit_is_noticed_and_the_photo_tried_again(full, caplog):
    full.write_text(full.read_text().replace('"t": [2, 0.1, 1]', '"t": [2, 0.3, 1]'))
    assert sorted(resumed(full)) == [0, 1, 3]
    assert "1 result in " in caplog.text and "was changed after being written" in caplog.text
    assert frames(full.with_name("results.json.old"))[0]["t"] == [2, 0.3, 1], "a hand may have changed it on purpose"


@pytest.mark.parametrize("place", ["results", "journal"])
def test_no_flipped_bit_gives_a_wrong_answer_or_costs_another_photo(path, place):
    store = ResultStore(path, KEYS)
    store.__enter__()
    for i in range(4):
        store.put(i, record(i))
    if place == "results":
        store.__exit__(None, None, None)
    else:
        killed(store)
    file = path if place == "results" else journal(path)
    data = file.read_bytes()
    for at in range(0, len(data), 11):
        file.write_bytes(data[:at] + bytes([data[at] ^ (1 << at % 8)]) + data[at + 1 :])
        found = resumed(path)
        assert len(found) >= 2 and all(one == stored(i) for i, one in found.items()), at
        assert [one["file"] for one in frames(path)] == [f"{i}.jpg" for i in sorted(found)], "what is left is whole"
        if place == "journal":
            path.unlink()


@pytest.mark.parametrize(
    "text",
    ["", "{", "words", "[]", "3", "null", '{"frames": 3}', '{"frames": [{"file": "a.jpg"}]}', '{"R": [], "t": []}', "\x00\x01"],
)
def test_a_file_that_is_something_else_is_refused_and_kept(path, text):
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(ResultsError, match=r"no results file of a batch; give another --out\.$") as caught:
        ResultStore(path, KEYS).__enter__()
    assert "\n" not in str(caught.value)
    assert path.read_text() == text
    assert os.listdir(path.parent) == ["results.json"]


def test_a_journal_that_is_something_else_is_refused_and_kept(full):
    journal(full).write_text("notes of a journey\n")
    with pytest.raises(ResultsError, match=r"no journal of a batch; give another --out\.$"):
        ResultStore(full, KEYS).__enter__()
    assert journal(full).read_text() == "notes of a journey\n"


def test_a_full_disk_loses_nothing_that_was_there(full, monkeypatch, each_synced):
    before = full.read_bytes()
    fsync, full_now = os.fsync, []

    def no_space(handle):
        if full_now:
            raise OSError(28, "No space left on device")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(OSError, match="No space left"), ResultStore(full, KEYS) as store:
        store.put(1, record(1, t=[8, 8, 8]))
        full_now.append(True)
        store.put(0, record(0, verdict="trusted"))
    assert full.read_bytes() == before
    assert sorted(os.listdir(full.parent)) == ["results.json", "results.json.journal"]
    full_now.clear()
    found = resumed(full)
    assert (found[1]["t"], found[0]["verdict"]) == ([8, 8, 8], "check")


def test_halves_of_killed_writes_are_removed(full):
    (full.parent / ".results.json.0a1b2c3d.part").write_text("half")
    (full.parent / ".others.json.0a1b2c3d.part").write_text("another's")
    resumed(full)
    assert sorted(os.listdir(full.parent)) == [".others.json.0a1b2c3d.part", "results.json"]


def test_ctrl_c_between_the_journal_and_the_memory_loses_no_result(path, monkeypatch, each_synced):
    sync = os.fsync

    def interrupted(handle):
        sync(handle)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ResultStore(path, KEYS) as store:
        store.put(0, record(0))
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", interrupted)
            store.put(1, record(1))
    assert [f["file"] for f in frames(path)] == ["0.jpg", "1.jpg"]


def test_a_record_that_takes_the_place_of_another_and_cannot_be_written_leaves_the_first(path, monkeypatch, each_synced):
    def full_disk(handle):
        raise OSError(28, "No space left on device")

    with ResultStore(path, KEYS) as store:
        store.put(0, record(0))
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", full_disk)
            with pytest.raises(OSError, match="No space"):
                store.put(0, record(0, verdict="trusted"))
        assert store.records[0]["verdict"] == "check"
    assert [f["verdict"] for f in frames(path)] == ["check"]


def shared(i):
    return record(i, verdict="trusted", own={"verdict": "check"})


def test_shared_records_stand_in_the_results_and_the_own_ones_come_back(path):
    with ResultStore(path, KEYS) as store:
        for i in (2, 0, 3, 1):
            store.put(i, record(i))
        assert '"own"' not in journal(path).read_text()
        for i in (1, 3):
            store.share(i, shared(i))
        assert store.records[1]["verdict"] == "trusted"
    first = path.read_text()
    assert [f["verdict"] for f in frames(path)] == ["check", "trusted", "check", "trusted"]
    with ResultStore(path, KEYS) as store:
        assert path.read_text() == first, "nothing is lost by a run that is killed at once"
        assert {i: r["verdict"] for i, r in store.records.items()} == dict.fromkeys(range(4), "check")
        assert all("own" not in r for r in store.records.values())
        for i in (3, 1):
            store.share(i, {**store.records[i], "verdict": "trusted", "own": {"verdict": "check"}})
    assert path.read_text() == first
    resumed(path)  # a run that shares nothing
    assert [f["verdict"] for f in frames(path)] == ["check"] * 4
    assert "own" not in path.read_text()


def test_a_photo_that_is_added_leaves_the_own_records_of_the_others(path):
    with ResultStore(path, KEYS[:2]) as store:
        for i in range(2):
            store.put(i, record(i))
            store.share(i, shared(i))
    store = ResultStore(path, KEYS)
    store.__enter__()
    store.put(2, record(2))
    killed(store)
    assert {i: r["verdict"] for i, r in resumed(path).items()} == dict.fromkeys(range(3), "check")


def test_results_whose_folder_is_taken_away_stay_in_the_journal_there(path):
    """A network's folder that comes back would hide what was written in its place meanwhile."""
    away = path.parent.with_name("away")
    with (
        pytest.raises(FileNotFoundError, match="what is finished stays in its journal there"),
        ResultStore(path, KEYS) as store,
    ):
        store.put(1, record(1))
        path.parent.rename(away)
        store.put(2, record(2))
    assert not path.parent.exists()
    away.rename(path.parent)
    assert sorted(resumed(path)) == [1, 2]
    assert os.listdir(path.parent) == ["results.json"]
