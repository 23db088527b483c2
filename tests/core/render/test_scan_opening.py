"""A scan prepared once for all processes: what is found again is what was prepared, and damage never passes for it."""

import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from render_scenes import cloud, make_scene

from core.cameras.training_world import ScanAxes
from core.errors import SplatFormatError
from core.geometry.camera import Intrinsics, Pose
from core.render import ProcessRenderer, Renderer, RenderSettings, processes
from core.render.scan import opening
from core.render.scan.file import HEAD_BYTES, SAMPLE
from core.render.scan.opening import open_scan, scans_folder
from core.splats import read_splats
from core.splats.ply.reader import write_ply

CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
COUNT = 2 * SAMPLE + 7


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    means, scales = cloud(COUNT)
    path = tmp_path_factory.mktemp("scan") / "scan.ply"
    write_ply(path, make_scene(means, scales * 0.2))
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GSSMC_SCAN_CACHE", str(tmp_path / "scans"))
    monkeypatch.setattr(opening, "LEAST_BYTES", 0)
    monkeypatch.setattr(opening, "SPARE_BYTES", 0)
    return tmp_path / "scans"


def kept(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.exists() else []


def assert_same_scan(a, b) -> None:
    assert np.array_equal(a.tables.block.view(np.uint32), b.tables.block.view(np.uint32))
    assert np.array_equal(a.tables.origin, b.tables.origin)
    assert (a.near, a.tables.antialiased) == (b.near, b.tables.antialiased)
    assert all(np.array_equal(v, getattr(b.sample, n)) for n, v in asdict(a.sample).items())


def test_a_kept_scan_is_found_again_to_the_bit(scan, folder, monkeypatch):
    first = open_scan(scan)
    (file,) = kept(folder)
    assert first.tables.file is not None, "the first process maps the file as well, and lets its own copy go"
    monkeypatch.setattr(opening, "read_splats", None)  # it would be called where the file is not used
    again = open_scan(scan)
    assert_same_scan(first, again)
    assert again.tables.file.path == str(file)
    whole = read_splats(scan)
    settings = RenderSettings.for_scene(whole)
    assert again.settings() == settings
    want, got = (Renderer(one, settings).render(CAMERA, Pose()) for one in (whole, again.tables))
    assert np.array_equal(want.color, got.color)


def test_what_is_asked_of_a_scan_besides_drawing_is_kept(scan, folder):
    whole, again = read_splats(scan), (open_scan(scan), open_scan(scan))[1]
    assert again.sample.origin == whole.origin
    want, got = ScanAxes.of(whole), ScanAxes.of(again.sample)
    assert np.array_equal(want.points, got.points)
    assert np.array_equal(want.weights, got.weights)
    assert (want.turns, want.orientation) == (got.turns, got.orientation)


@pytest.mark.parametrize("where", [10, HEAD_BYTES + 4096, -3, None])
def test_a_damaged_file_is_said_and_made_again(scan, folder, caplog, where):
    first = open_scan(scan)
    (file,) = kept(folder)
    data = bytearray(file.read_bytes())
    if where is not None:
        data[where] ^= 0x40
    del first
    file.write_bytes(data if where is not None else data[: len(data) // 2])
    again = open_scan(scan)
    assert "damaged" in caplog.text
    caplog.clear()
    assert_same_scan(again, open_scan(scan))
    assert not caplog.records
    assert kept(folder) == [file]


def test_another_scan_in_the_same_place_is_read_anew(scan, folder, tmp_path):
    copy = tmp_path / "scan.ply"
    copy.write_bytes(scan.read_bytes())
    before = open_scan(copy)
    means, scales = cloud(COUNT, seed=9)
    write_ply(copy, make_scene(means, scales))
    after = open_scan(copy)
    assert len(kept(folder)) == 2
    assert not np.array_equal(before.tables.means, after.tables.means)


def test_small_scans_and_a_cache_that_is_off_leave_no_file(scan, folder, monkeypatch):
    monkeypatch.setattr(opening, "LEAST_BYTES", 10**9)
    assert open_scan(scan).tables.file is None
    monkeypatch.setattr(opening, "LEAST_BYTES", 0)
    monkeypatch.setenv("GSSMC_SCAN_CACHE", "off")
    assert scans_folder() is None
    assert open_scan(scan).tables.file is None
    assert kept(folder) == []


def test_a_full_disk_or_a_locked_folder_costs_only_the_file(scan, folder, monkeypatch):
    monkeypatch.setattr(opening, "SPARE_BYTES", 10**18)
    assert len(open_scan(scan).tables) > 0
    assert kept(folder) == []
    monkeypatch.setattr(opening, "SPARE_BYTES", 0)
    folder.rmdir()
    folder.write_text("in the way")
    assert len(open_scan(scan).tables) > 0


def test_the_one_that_was_not_used_for_the_longest_makes_room(scan, folder, monkeypatch):
    open_scan(scan)
    (file,) = kept(folder)
    size = file.stat().st_size
    old, used = (file.with_name(f"{name}{opening.SUFFIX}") for name in ("old", "used"))
    for one, age in ((old, 100), (used, 10)):
        one.write_bytes(b"x" * size)
        os.utime(one, (time.time() - age,) * 2)
    file.unlink()
    monkeypatch.setattr(opening, "LIMIT_BYTES", 2.5 * size)
    open_scan(scan)
    assert kept(folder) == sorted([used, file])


def test_what_a_killed_process_left_is_removed(scan, folder):
    folder.mkdir(parents=True)
    other = folder / f"other{opening.SUFFIX}"
    (folder / f"{other.name}{opening.LOCK}").touch()
    (folder / f".{other.name}.0123.part").write_bytes(b"half")
    open_scan(scan)
    assert [one.suffix for one in kept(folder)] == [opening.SUFFIX]


def test_a_scan_that_cannot_be_read_says_so(folder, tmp_path):
    with pytest.raises(SplatFormatError, match="no splat file"):
        open_scan(tmp_path / "none.ply")
    (tmp_path / "text.ply").write_text("nothing")
    with pytest.raises(SplatFormatError):
        open_scan(tmp_path / "text.ply")
    assert kept(folder) == []


def test_of_two_that_open_a_scan_together_one_reads_it(scan, folder, monkeypatch):
    """Threads, because a lock keeps them apart as it does processes."""
    reads = []

    def slow(*args):
        reads.append(None)
        time.sleep(0.5)
        return read_splats(*args)

    monkeypatch.setattr(opening, "read_splats", slow)
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(open_scan, [scan, scan])
    assert_same_scan(first, second)
    assert len(reads) == 1
    assert [one.suffix for one in kept(folder)] == [opening.SUFFIX]


def test_children_map_the_kept_file_itself(scan, folder, monkeypatch):
    opened = open_scan(scan)
    monkeypatch.setattr(processes, "ScratchFolder", None)  # for a copy of the tables
    want = Renderer(opened.tables, RenderSettings(threads=1)).render(CAMERA, Pose())
    with ProcessRenderer(opened.tables, RenderSettings(threads=2)) as renderer:
        end = time.monotonic() + 60
        while not renderer._children._ready and time.monotonic() < end:
            time.sleep(0.05)
        assert renderer._children._ready
        got = renderer.render(CAMERA, Pose())
    assert np.array_equal(want.color, got.color)
