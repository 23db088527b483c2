"""The results file of a batch: always in order, always whole on disk, and as much of it taken up again as is sound."""

import json
import os

import pytest

from core.batch.store import ResultsError, ResultStore, job_key

pytestmark = pytest.mark.unit

KEYS = [job_key("photo", i) for i in range(4)]


def record(i, **more):
    return {
        "file": f"{i}.jpg",
        "verdict": "check",
        "reasons": ['Words with "quotes", {braces} and ümlauts.'],
        "t": [i, 0.1, 1],
    } | more


@pytest.fixture
def path(tmp_path):
    return tmp_path / "deep" / "results.json"


@pytest.fixture
def full(path):
    store = ResultStore(path, KEYS)
    for i in (2, 0, 3, 1):  # workers finish in any order
        store.put(i, record(i))
    return path


def resumed(path, keys=KEYS):
    store = ResultStore(path, keys)
    count = store.resume()
    assert count == len(store.records)
    return store.records


def test_records_stand_in_the_order_of_the_queries(full):
    frames = json.loads(full.read_text())["frames"]
    assert [f["file"] for f in frames] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]
    assert [f["key"] for f in frames] == KEYS


def test_the_file_is_whole_after_every_record(path):
    store = ResultStore(path, KEYS)
    store.save()
    assert json.loads(path.read_text()) == {"frames": []}
    for done, i in enumerate((3, 1), 1):
        store.put(i, record(i))
        assert len(json.loads(path.read_text())["frames"]) == done
    assert os.listdir(path.parent) == ["results.json"]


def test_a_second_run_takes_up_what_was_finished(full):
    found = resumed(full)
    assert {i: r["t"] for i, r in found.items()} == {i: [i, 0.1, 1] for i in range(4)}


def test_queries_may_be_added_removed_and_moved(full):
    found = resumed(full, [KEYS[3], job_key("new"), KEYS[0]])
    assert {i: r["file"] for i, r in found.items()} == {0: "3.jpg", 2: "0.jpg"}


def test_photos_that_could_not_be_tried_are_tried_again(full):
    store = ResultStore(full, KEYS)
    store.resume()
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
        assert all(r == record(i) | {"key": KEYS[i]} for i, r in found.items())


def test_a_cut_file_is_mended_by_the_next_save(full):
    full.write_bytes(full.read_bytes()[:-40])
    store = ResultStore(full, KEYS)
    assert store.resume() == 3
    store.put(3, record(3))
    assert len(json.loads(full.read_text())["frames"]) == 4


@pytest.mark.parametrize(
    "text",
    ["", "{", "words", "[]", "3", "null", '{"frames": 3}', '{"frames": [{"file": "a.jpg"}]}', '{"R": [], "t": []}', "\x00\x01"],
)
def test_a_file_that_is_something_else_is_refused_and_kept(path, text):
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(ResultsError, match=r"no results file of a batch; give another --out\.$") as caught:
        ResultStore(path, KEYS).resume()
    assert "\n" not in str(caught.value)
    assert path.read_text() == text


def test_a_save_that_fails_leaves_the_old_file(full, monkeypatch):
    before = full.read_bytes()

    def no_space(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    store = ResultStore(full, KEYS)
    store.resume()
    with pytest.raises(OSError, match="No space left"):
        store.put(0, record(0, verdict="trusted"))
    assert full.read_bytes() == before
    assert os.listdir(full.parent) == ["results.json"]


def test_keys_differ_where_an_answer_may():
    assert job_key("a", 1, {"seed": 0}) == job_key("a", 1, {"seed": 0})
    assert (
        len({job_key("a", 1, {"seed": 0}), job_key("a", 1, {"seed": 1}), job_key("a", 2, {"seed": 0}), job_key("a1", {})}) == 4
    )
