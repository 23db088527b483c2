"""Answers are taken up again only where all that they depend on is as it was, whatever the files are called."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.batch.executors import Executor
from core.batch.keys import BLOCK_BYTES, BLOCKS, BatchQuery, check_unchanged, key_of, query_keys, scan_file_digest
from core.batch.store import ResultStore
from core.cli.rounds import Rounds
from core.errors import SplatFormatError
from core.geometry.camera import Camera, Intrinsics, Pose
from core.pose.settings import RefineSettings
from core.splats.ply.reader import write_ply
from core.synthetic import make_scene

CAMERA = Camera(Intrinsics(640, 480, 500, 500, 320, 240), Pose(), "photo.jpg")
TIME_NS = 1_700_000_000_123_456_789


def put(path, data, time_ns=TIME_NS):
    path.write_bytes(data)
    os.utime(path, ns=(time_ns, time_ns))
    return path


@pytest.fixture
def files(tmp_path):
    """A scan that is larger than what is read of it, a photo, a mask, a model."""
    put(tmp_path / "scan.ply", np.random.default_rng(0).bytes(2 * BLOCKS * BLOCK_BYTES))
    for name in ("photo.jpg", "mask.png", "model.onnx"):
        put(tmp_path / name, b"0123456789")
    return tmp_path


def key(files, **settings):
    query = BatchQuery(CAMERA, files / "photo.jpg", files / "mask.png")
    return query_keys(files / "scan.ply", [query], RefineSettings(model=str(files / "model.onnx"), **settings))[0]


def test_the_same_files_have_the_same_key(files):
    assert key(files) == key(files)
    assert key(files, threads=1) == key(files, threads=7)


def test_a_renamed_scan_is_the_same_scan(files):
    before = key(files)
    (files / "scan.ply").rename(files / "other.ply")
    query = BatchQuery(CAMERA, files / "photo.jpg", files / "mask.png")
    assert query_keys(files / "other.ply", [query], RefineSettings(model=str(files / "model.onnx")))[0] == before


@pytest.mark.parametrize("where", [0, -1, 0.25, 0.5, 0.9])
def test_another_training_of_the_same_size_under_the_same_name_is_another_scan(files, where):
    """Also where it has the same time, as archives and copies give it. Changed at one place only, and over a stretch that no
    reading of spread-out blocks can miss.
    """
    before, scan = key(files), files / "scan.ply"
    data = bytearray(scan.read_bytes())
    begin = len(data) - BLOCK_BYTES if where == -1 else int(where * len(data))
    length = 4 if where in (0, -1) else 2 * len(data) // BLOCKS
    data[begin : begin + length] = bytes(255 - b for b in data[begin : begin + length])
    put(scan, bytes(data))
    assert key(files) != before


@pytest.mark.parametrize("name", ["scan.ply", "photo.jpg", "mask.png", "model.onnx"])
def test_every_file_counts_by_its_time_and_its_size(files, name):
    before, data = key(files), (files / name).read_bytes()
    put(files / name, data, TIME_NS + 1)  # replaced by another in the same second
    later = key(files)
    put(files / name, data + b"x")
    assert len({before, later, key(files)}) == 3


def test_settings_start_and_mask_count(files):
    keys = {key(files), key(files, seed=5)}
    for query in (
        BatchQuery(replace(CAMERA, pose=Pose(np.eye(3), [0, 0, 1])), files / "photo.jpg", files / "mask.png"),
        BatchQuery(CAMERA, files / "photo.jpg"),
        BatchQuery(CAMERA, files / "mask.png", files / "mask.png"),
    ):
        keys |= set(query_keys(files / "scan.ply", [query], RefineSettings(model=str(files / "model.onnx"))))
    assert len(keys) == 5


def test_photos_that_are_missing_have_a_key_and_another_once_they_are_there(files):
    (files / "photo.jpg").unlink()
    before = key(files)
    put(files / "photo.jpg", b"0123456789")
    assert key(files) != before


def test_a_small_scan_is_read_whole(tmp_path):
    digests = {scan_file_digest(put(tmp_path / "s.ply", b"a" * k + b"b" + b"a" * (9 - k))) for k in range(10)}
    assert len(digests) == 10


def test_a_scan_that_cannot_be_read_is_one_sentence(tmp_path):
    with pytest.raises(SplatFormatError, match=r"cannot be read .*check the path\.$"):
        scan_file_digest(Path(tmp_path))


def test_key_changes_with_everything_it_is_made_of():
    assert key_of("s", 1, {"a": 1, "b": 2}) == key_of("s", 1, {"b": 2, "a": 1})
    assert len({key_of("s", 1, {}), key_of("s", 2, {}), key_of("t", 1, {}), key_of("s", 1, {"a": 0})}) == 4


@pytest.mark.parametrize("name", ["photo.jpg", "mask.png"])
def test_a_query_knows_when_its_files_are_other_ones(files, name):
    query = BatchQuery(CAMERA, files / "photo.jpg", files / "mask.png")
    assert not query.is_changed
    before = query_keys(files / "scan.ply", [query], RefineSettings())
    put(files / name, b"9876543210", TIME_NS + 1)
    assert query.is_changed
    assert query_keys(files / "scan.ply", [query], RefineSettings()) == before, "the key stands for what it was"
    put(files / name, b"0123456789")
    assert not query.is_changed
    (files / name).unlink()
    assert query.is_changed


def test_a_scan_that_is_replaced_before_a_worker_reads_it_ends_the_batch_without_an_answer(tmp_path):
    """The keys of the answers stand for the first scan."""
    scan, out = tmp_path / "scan.ply", tmp_path / "r.json"
    write_ply(scan, make_scene(0, 300))
    digest, query = scan_file_digest(scan, dated=False), BatchQuery(CAMERA, put(tmp_path / "photo.jpg", b"no photo"))
    write_ply(scan, make_scene(1, 300))
    with pytest.raises(SplatFormatError, match=r"'scan\.ply' was changed while it was being used; run the command again\.$"):
        check_unchanged(scan, digest)
    with ResultStore(out, ["key"]) as store:
        with pytest.raises(SplatFormatError, match="was changed while it was being used"):
            Rounds(scan, Executor(1), RefineSettings(), None, digest).run([query], store)
        assert store.records == {}


def test_a_photo_that_is_replaced_while_it_is_worked_on_is_tried_again_by_the_next_run(tmp_path):
    write_ply(tmp_path / "scan.ply", make_scene(0, 300))
    query = BatchQuery(CAMERA, put(tmp_path / "photo.jpg", b"no photo"))
    put(tmp_path / "photo.jpg", b"another.", TIME_NS + 1)
    with ResultStore(tmp_path / "r.json", ["key"]) as store:
        Rounds(
            tmp_path / "scan.ply", Executor(1), RefineSettings(), None, scan_file_digest(tmp_path / "scan.ply", dated=False)
        ).run([query], store)
        assert "was changed while the batch ran; run the batch again." in store.records[0]["error"]
    with ResultStore(tmp_path / "r.json", ["key"]) as store:
        assert store.records == {}
