"""Views drawn in other processes: the same to the bit, whatever becomes of the processes, and nothing left behind."""

from __future__ import annotations

import gc
import logging
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from render_scenes import cloud, make_scene

from core.errors import Cancelled
from core.geometry.camera import Intrinsics, Pose
from core.geometry.lie import se3_exp
from core.processes.child import Child
from core.render import ProcessRenderer, RenderedView, Renderer, RenderSettings
from core.render import processes as process_renderer
from core.splats.scene import GaussianScene

pytestmark = pytest.mark.process

CAMERA = Intrinsics(61, 43, 50.0, 55.0, 28.0, 24.0)
SETTINGS = RenderSettings(threads=3)
LIMIT_S = 60.0


class Starter:
    """Starts children and remembers them; `fails` as a system without processes to give would."""

    def __init__(self, fails: bool = False) -> None:
        self.children: list[Child] = []
        self.fails = fails

    def __call__(self, module: str, environment: Mapping[str, str]) -> Child:
        if self.fails:
            raise OSError("no more processes")
        self.children.append(Child(module, environment))
        return self.children[-1]

    def ended(self) -> bool:
        return all(child.exit_code() is not None for child in self.children)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the shared files go."""
    (tmp_path / "shared").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "shared"))
    return tmp_path / "shared"


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> GaussianScene:
    monkeypatch.setattr(process_renderer, "MIN_GAUSSIANS", 1)
    return make_scene(*cloud())


def poses(count: int) -> list[Pose]:
    rng = np.random.default_rng(3)
    return [se3_exp(0.1 * rng.normal(size=6)) for _ in range(count)]


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def ready(renderer: ProcessRenderer, count: int) -> Callable[[], bool]:
    return lambda: len(renderer._children._ready) == count


@pytest.fixture
def started(scene) -> Iterator[tuple[ProcessRenderer, Starter]]:
    """A renderer whose two other processes are ready to draw."""
    starter = Starter()
    with ProcessRenderer(scene, SETTINGS, starter) as renderer:
        renderer.render(CAMERA, Pose())
        wait_for(ready(renderer, 2))
        yield renderer, starter


def same(a: RenderedView, b: RenderedView) -> bool:
    return all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("color", "depth", "alpha", "depth_variance"))


def test_views_are_those_of_one_process_to_the_bit(scene, started):
    alone = Renderer(scene, RenderSettings(threads=1))
    wanted = poses(12)
    with ThreadPoolExecutor(5) as pool:  # more at once than there are processes
        found = list(pool.map(lambda pose: started[0].render(CAMERA, pose), wanted))
    assert all(same(view, alone.render(CAMERA, pose)) for view, pose in zip(found, wanted, strict=True))
    assert found[0].alpha.max() > 0.5
    assert not same(found[0], found[1])


def test_the_processes_draw_an_antialiased_scan_as_one(scene):
    soft = replace(scene, antialiased=True)
    with ProcessRenderer(soft, SETTINGS, Starter()) as renderer:
        wait_for(ready(renderer, 2))
        assert same(renderer.render(CAMERA, Pose()), Renderer(soft, RenderSettings(threads=1)).render(CAMERA, Pose()))


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_process_that_dies_costs_no_view(scene, started, caplog, deaths):
    renderer, _ = started
    with caplog.at_level(logging.WARNING):
        for child in renderer._children._ready[-deaths:]:  # the last is asked first
            child.kill()
        found = [renderer.render(CAMERA, pose) for pose in poses(4)]
    alone = Renderer(scene, RenderSettings(threads=1))
    assert all(same(view, alone.render(CAMERA, pose)) for view, pose in zip(found, poses(4), strict=True))
    assert "has ended" in caplog.text
    assert ready(renderer, 2 - deaths)()


def test_a_spared_process_draws_only_where_no_other_is(scene, monkeypatch):
    alone, here = Renderer(scene, RenderSettings(threads=1)), []
    with ProcessRenderer(scene, RenderSettings(threads=2), interactive=True) as renderer:
        wait_for(ready(renderer, 2))
        monkeypatch.setattr(renderer._here, "render", lambda *view: here.append(view) or alone.render(*view))
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda pose: renderer.render(CAMERA, pose), poses(8)))
        assert not here
        assert all(same(view, alone.render(CAMERA, pose)) for view, pose in zip(found, poses(8), strict=True))
        assert same(renderer.sole.render(CAMERA, Pose()), alone.render(CAMERA, Pose()))
        for child in renderer._children._ready:
            child.kill()
        assert same(renderer.render(CAMERA, Pose()), alone.render(CAMERA, Pose()))
        assert len(here) == 1


@pytest.mark.parametrize("missing", ["processes", "folder"])
def test_without_processes_views_are_drawn_here(scene, folder, monkeypatch, missing):
    if missing == "folder":
        monkeypatch.setattr(tempfile, "tempdir", str(folder / "none"))
    starter = Starter(fails=missing == "processes")
    with ProcessRenderer(scene, SETTINGS, starter) as renderer, ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda pose: renderer.render(CAMERA, pose), poses(6)))
    alone = Renderer(scene, RenderSettings(threads=1))
    assert all(same(view, alone.render(CAMERA, pose)) for view, pose in zip(found, poses(6), strict=True))
    assert not starter.children


def test_nothing_is_left_behind(folder, started):
    renderer, starter = started
    renderer.close()
    assert starter.ended()
    assert not list(folder.iterdir())
    with pytest.raises(Cancelled):
        renderer.render(CAMERA, Pose())
    renderer.close()


def test_nothing_is_left_behind_by_one_that_is_forgotten(scene, folder):
    starter = Starter()
    renderer = ProcessRenderer(scene, SETTINGS, starter)
    renderer.render(CAMERA, Pose())
    wait_for(ready(renderer, 2))
    del renderer
    gc.collect()
    assert starter.ended()
    assert not list(folder.iterdir())


def test_closing_ends_views_that_are_being_drawn(started):
    renderer, starter = started
    large, ended = Intrinsics(6000, 4000, 5000.0, 5000.0, 3000.0, 2000.0), []

    def draw() -> None:
        try:
            renderer.render(large, Pose())
        except Cancelled:
            ended.append(True)

    threads = [threading.Thread(target=draw) for _ in starter.children]
    for thread in threads:
        thread.start()
    wait_for(ready(renderer, 0))
    renderer.close()
    for thread in threads:
        thread.join(LIMIT_S)
    assert ended == [True] * len(threads)
    assert starter.ended()


def test_one_closed_while_its_processes_start_leaves_none(scene):
    starter = Starter()
    renderer = ProcessRenderer(scene, SETTINGS, starter)
    renderer.render(CAMERA, Pose())
    renderer.close()
    wait_for(lambda: not any(t.name == "gssmc-start" for t in threading.enumerate()))
    assert starter.ended()


def most_at_once(renderer: ProcessRenderer, monkeypatch: pytest.MonkeyPatch, asked: int = 12) -> int:
    """How many views are drawn at a time in this process when `asked` are wanted."""
    lock, now, most = threading.Lock(), [0], [0]

    def draw(*view):
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
        time.sleep(0.5)
        with lock:
            now[0] -= 1

    monkeypatch.setattr(renderer._here, "render", draw)
    with ThreadPoolExecutor(asked) as pool:
        list(pool.map(lambda pose: renderer.render(CAMERA, pose), poses(asked)))
    return most[0]


@pytest.mark.parametrize("interactive", [False, True])
def test_processes_that_die_at_their_start_do_not_change_how_many_views_are_drawn(scene, monkeypatch, interactive):
    starter = Starter()
    with ProcessRenderer(
        scene, RenderSettings(threads=4), lambda _, environment: starter("no_such_module", environment), interactive=interactive
    ) as renderer:
        wait_for(lambda: len(starter.children) == 3 + interactive and not renderer._children._all)
        assert most_at_once(renderer, monkeypatch) == 4


def test_processes_that_die_later_leave_their_views_to_this_one(scene, monkeypatch):
    with ProcessRenderer(scene, RenderSettings(threads=3)) as renderer:
        wait_for(ready(renderer, 2))
        for child in renderer._children._ready:
            child.kill()
        assert most_at_once(renderer, monkeypatch) == 3


@pytest.mark.skipif(os.name == "nt", reason="SIGSTOP")
def test_a_process_that_is_stuck_costs_no_view(scene, started, monkeypatch, caplog):
    renderer, starter = started
    monkeypatch.setattr(process_renderer, "LIMIT_S", 2.0)
    for child in starter.children:
        os.kill(child._process.pid, signal.SIGSTOP)
    found: list[RenderedView] = []
    thread = threading.Thread(target=lambda: found.append(renderer.render(CAMERA, Pose())), daemon=True)
    thread.start()
    thread.join(LIMIT_S)
    if thread.is_alive():
        for child in starter.children:
            child._process.kill()
    assert same(found[0], Renderer(scene, RenderSettings(threads=1)).render(CAMERA, Pose()))
    assert "no answer in 2 s" in caplog.text


@pytest.mark.skipif(sys.platform != "linux", reason="children are found in /proc")
@pytest.mark.parametrize("when", ["while its processes start", "while they draw"])
def test_a_process_that_is_killed_leaves_no_tables_on_disk_and_no_other_process(scene, folder, when):
    """Killed early, it leaves them until the next one starts."""
    code = f"""
import os, sys, time
from pathlib import Path
sys.path[:0] = {[str(Path(__file__).parents[3]), str(Path(__file__).parents[1] / "support")]!r}
from core.geometry.camera import Intrinsics, Pose
from core.render import ProcessRenderer, RenderSettings, processes
from render_scenes import cloud, make_scene
processes.MIN_GAUSSIANS = 1
renderer = ProcessRenderer(make_scene(*cloud()), RenderSettings(threads=3))
folder, end = Path(os.environ["TMPDIR"]), time.monotonic() + 60
while {when == "while they draw"} and (len(renderer._children._ready) < 2 or [*folder.iterdir()]) and time.monotonic() < end:
    time.sleep(0.02)
print("ready", flush=True)
time.sleep(600)
"""
    environment = {**os.environ, "TMPDIR": str(folder)}
    parent = subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE)
    assert parent.stdout is not None and parent.stdout.readline() == b"ready\n"
    children = [int(n) for n in Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()]
    parent.kill()
    parent.wait()
    if when == "while they draw":
        assert not list(folder.iterdir())
        assert len(children) == 2
    for left in folder.iterdir():
        os.utime(left, (0, 0))
    with ProcessRenderer(scene, SETTINGS) as renderer:
        wait_for(ready(renderer, 2))
        wait_for(lambda: not list(folder.iterdir()))
    wait_for(lambda: not any(alive(pid) for pid in children))


def alive(pid: int) -> bool:
    state = Path(f"/proc/{pid}/stat")
    try:
        return state.read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_one_thread_needs_no_process_nor_does_a_small_or_empty_scene(scene, monkeypatch):
    starter = Starter()
    monkeypatch.setattr(process_renderer, "MIN_GAUSSIANS", 201)
    for what, threads in ((make_scene(*cloud(2000)), 1), (scene, 3), (make_scene(*(a[:0] for a in cloud())), 3)):
        with ProcessRenderer(what, RenderSettings(threads=threads), starter) as renderer:
            view = renderer.render(CAMERA, Pose())
            assert same(view, Renderer(what, RenderSettings(threads=1)).render(CAMERA, Pose()))
    assert not starter.children
