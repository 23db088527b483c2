"""The map between photos: made once, believed only where it is of this scan, and never lost by whoever stops in between."""

import logging
import os
import subprocess
import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from core.locate import MapCache, MapFileError, MapPlace, MapSettings, cache, write_map
from core.locate.cache import SUFFIX
from core.splats.ply.reader import write_ply
from core.support.cache_folder import user_cache_folder
from core.synthetic.room import make_scene
from core.synthetic.sample import sample_cameras

VIEWS = 3
SETTINGS = MapSettings(views=VIEWS, side_px=160, threads=1)
KNOWN = sample_cameras(VIEWS)  # a map of known cameras alone needs no search for viewpoints, which takes its time


@pytest.fixture(scope="module")
def scene():
    return make_scene(gaussians=6000)


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """The user's cache folder of the test."""
    monkeypatch.setattr(cache, "user_cache_folder", lambda: tmp_path / "home")
    return tmp_path / "home"


@pytest.fixture
def builds(monkeypatch):
    """How often a map was begun to be made."""
    begun, build = [], cache.build_map
    monkeypatch.setattr(cache, "build_map", lambda *args: begun.append(args) or build(*args))
    return begun


def place(folder):
    return MapPlace(folder / "room.ply")


def beside(folder):
    return folder / f"room.ply{SUFFIX}"


def made(scene, folder, settings=SETTINGS, known=KNOWN):
    """The whole map, from the cache or anew."""
    return list(MapCache(scene, place(folder), settings, known).steps())[-1].map


def same(a, b):
    return len(a) == len(b) and all(np.array_equal(x.points, y.points) for x, y in zip(a.views, b.views, strict=True))


def test_a_map_is_made_once_and_lies_beside_the_scan(scene, tmp_path, builds, home):
    first = made(scene, tmp_path)
    assert (len(first), first.complete, len(builds)) == (VIEWS, True, 1)
    assert [p.name for p in tmp_path.iterdir()] == [beside(tmp_path).name]
    again = MapCache(scene, place(tmp_path), SETTINGS, KNOWN)
    steps = list(again.steps())
    assert [len(step.map) for step in steps] == [1, 2, 3, 3]
    assert steps[-1].fraction == 1
    assert same(steps[-1].map, first)
    assert len(builds) == 1
    assert again.stored_in() == beside(tmp_path)
    assert not home.exists()


def test_another_scan_under_the_same_name_gets_its_own_map(scene, tmp_path, builds, caplog):
    first = made(scene, tmp_path)
    other = replace(scene, means=scene.means * np.float32(1.2))
    second = made(other, tmp_path)
    assert len(builds) == 2
    assert not same(first, second)
    assert "belongs to another scan" in caplog.text
    assert same(MapCache(other, place(tmp_path), SETTINGS, KNOWN).read(), second)


@pytest.mark.parametrize("damage", ["cut", "foreign", "empty", "zeros"])
def test_what_is_damaged_is_made_again_and_said(scene, tmp_path, builds, caplog, damage):
    first, file = made(scene, tmp_path), beside(tmp_path)
    data = file.read_bytes()
    middle = len(data) // 2
    zeros = data[:middle] + bytes(2000) + data[middle + 2000 :]
    file.write_bytes({"cut": data[:middle], "foreign": b"no map", "empty": b"", "zeros": zeros}[damage])
    assert same(made(scene, tmp_path), first)
    assert len(builds) == 2
    assert f"The map '{file.name}'" in caplog.text
    assert same(MapCache(scene, place(tmp_path), SETTINGS, KNOWN).read(), first)


def test_fewer_views_are_the_first_of_the_same_map(scene, tmp_path, builds):
    whole = made(scene, tmp_path)
    few = made(scene, tmp_path, replace(SETTINGS, views=2))
    assert few.complete
    assert same(few, replace(whole, views=whole.views[:2]))
    assert len(builds) == 1
    assert len(MapCache(scene, place(tmp_path), SETTINGS, KNOWN).read()) == VIEWS  # the larger one stays


def test_more_views_are_added_to_those_that_are_there(scene, tmp_path, builds):
    few = made(scene, tmp_path, replace(SETTINGS, views=1))
    steps = list(MapCache(scene, place(tmp_path), SETTINGS, KNOWN).steps())
    sizes = [len(step.map) for step in steps]
    assert (sizes, len(builds)) == (sorted(sizes), 2)
    assert steps[0].map.complete  # a photo is tried on what there is, before more is made
    assert all((step.map.views[0].points == few.views[0].points).all() for step in steps)
    fresh = made(scene, tmp_path / "elsewhere")
    assert same(steps[-1].map, fresh)
    assert len(MapCache(scene, place(tmp_path), SETTINGS, KNOWN).read()) == VIEWS


@pytest.mark.parametrize("end", [None, KeyboardInterrupt, MemoryError])
def test_whoever_stops_leaves_a_smaller_map(scene, tmp_path, end):
    work = MapCache(scene, place(tmp_path), SETTINGS, KNOWN).steps()
    assert len(list(islice(work, 3))[-1].map) == 2
    if end is None:
        work.close()
    else:
        with pytest.raises(end):
            work.throw(end)
    left = MapCache(scene, place(tmp_path), SETTINGS, KNOWN).read()
    assert (len(left), left.complete) == (2, False)
    assert [p.name for p in tmp_path.iterdir()] == [beside(tmp_path).name]
    assert len(made(scene, tmp_path)) == VIEWS


def test_nothing_is_written_before_there_is_a_view(scene, tmp_path):
    work = MapCache(scene, place(tmp_path), SETTINGS, KNOWN).steps()
    next(work)
    work.close()
    assert list(tmp_path.iterdir()) == []


def test_a_scan_that_gives_no_more_is_not_searched_again(scene, tmp_path, builds, monkeypatch):
    monkeypatch.setattr(cache, "build_map", lambda *args: builds.append(0) or _ended(args[3]))

    def _ended(key):
        yield cache.MapStep(cache.LandmarkMap(key, complete=True), "the map is complete", 1.0)

    assert len(made(scene, tmp_path)) == 0
    last = made(scene, tmp_path, replace(SETTINGS, views=50))
    assert (len(last), last.complete, len(builds)) == (0, True, 1)


def test_where_the_scans_folder_cannot_be_written_the_users_is_taken(scene, tmp_path, builds, home):
    beside(tmp_path).mkdir()  # no file can take its place, whoever asks
    first = made(scene, tmp_path)
    assert len(list(home.glob(f"*{SUFFIX}"))) == 1
    assert same(made(scene, tmp_path), first)
    assert len(builds) == 1


def test_the_users_folder_by_choice_knows_a_scan_that_was_moved(scene, tmp_path, builds, home):
    for name in ("a.ply", "moved/b.ply"):
        chosen = MapPlace(tmp_path / name, beside=False)
        assert len(list(MapCache(scene, chosen, SETTINGS, KNOWN).steps())[-1].map) == VIEWS
    assert len(builds) == 1
    assert [p for p in tmp_path.rglob(f"*{SUFFIX}") if p.parent != home] == []


def test_a_map_that_can_be_kept_nowhere_is_made_all_the_same(scene, tmp_path, home, caplog):
    beside(tmp_path).mkdir()
    home.write_text("in the way")
    assert len(made(scene, tmp_path)) == VIEWS
    assert "cannot be written" in caplog.text
    assert [r.levelno for r in caplog.records if "made again the next time" in r.message] == [logging.WARNING]


def test_the_users_folder_follows_the_system(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_cache_folder() == tmp_path / "gssmc"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, says the specification
    assert user_cache_folder() == Path.home() / ".cache" / "gssmc"
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "Local"))
    assert user_cache_folder() == tmp_path / "Local" / "gssmc" / "Cache"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert user_cache_folder() == Path.home() / "Library" / "Caches" / "gssmc"


def test_a_file_that_is_given_and_is_no_map_is_left_alone(scene, tmp_path):
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(b"a photo")
    with pytest.raises(MapFileError, match="is no map of a scan"):
        MapCache(scene, MapPlace(tmp_path / "room.ply", photo), SETTINGS, KNOWN)
    np.savez(tmp_path / "other.npz", head=np.arange(3))
    with pytest.raises(MapFileError, match="is no map of a scan"):
        MapCache(scene, MapPlace(tmp_path / "room.ply", tmp_path / "other.npz"), SETTINGS, KNOWN)
    assert photo.read_bytes() == b"a photo"


def test_a_map_with_known_cameras_serves_those_who_have_none_but_not_those_who_have_others(scene, tmp_path, builds):
    whole = made(scene, tmp_path)
    assert same(MapCache(scene, place(tmp_path), SETTINGS).read(), whole)
    others = MapCache(scene, place(tmp_path), SETTINGS, sample_cameras(4))
    assert len(others.read()) == 0
    assert len(MapCache(scene, place(tmp_path), replace(SETTINGS, side_px=200)).read()) == 0


def test_a_better_map_that_another_process_wrote_meanwhile_stays(scene, tmp_path):
    whole = made(scene, tmp_path)
    own = MapCache(scene, place(tmp_path), SETTINGS, KNOWN)
    assert own.keep(replace(whole, views=whole.views[:1], complete=False)) == beside(tmp_path)
    assert len(own.read()) == VIEWS
    write_map(beside(tmp_path), replace(whole, views=whole.views[:1], complete=False))
    own.keep(whole)
    assert len(own.read()) == VIEWS


@pytest.mark.process
def test_two_processes_at_once_do_no_harm(scene, tmp_path):
    write_ply(tmp_path / "room.ply", scene)
    code = f"""
import sys
from core.locate import MapCache, MapPlace, MapSettings
from core.splats import read_splats
from core.synthetic import sample_cameras
cache = MapCache(read_splats(sys.argv[1]), MapPlace(sys.argv[1]), MapSettings({VIEWS}, 160), sample_cameras({VIEWS}))
print(len(list(cache.steps())[-1].map), len(cache.read()))
"""
    command = [sys.executable, "-c", code, str(tmp_path / "room.ply")]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) for _ in range(2)]
    assert [one.communicate(timeout=120)[0].split() for one in both] == [[str(VIEWS), str(VIEWS)]] * 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["room.ply", f"room.ply{SUFFIX}"]
