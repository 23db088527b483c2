"""Children run the engine's own code, wherever they are started: the working folder may be anybody's."""

import json
import os
import sys
from pathlib import Path

import pytest

from core.processes.channel import Channel
from core.processes.child import Child, search_path

REPO = Path(__file__).parents[3]


@pytest.fixture
def trap(tmp_path, monkeypatch):
    """A working folder whose modules would be imported in place of the engine's and of Python's own."""
    folder = tmp_path / "scan from the net"
    code = f"import pathlib; pathlib.Path({str(tmp_path / 'sprung')!r}).touch(); raise SystemExit(9)"
    for name in ("json.py", "numpy.py", "cv2.py", "sitecustomize.py", "core/__init__.py"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(code)
    monkeypatch.chdir(folder)
    yield folder
    assert not (tmp_path / "sprung").exists()


def ask_for_no_scan():
    channel = Channel(Child("batch.worker"))
    try:
        return channel.ask({"scene": "no.ply", "settings": {}}, limit_s=60)[0]
    finally:
        channel.close()


@pytest.mark.parametrize("listed", ["nowhere", "as an absolute path", "through a link", "as a relative path"])
def test_a_child_runs_nothing_of_its_working_folder(trap, tmp_path, monkeypatch, listed):
    (tmp_path / "link").symlink_to(trap)
    here = {"as an absolute path": str(trap), "through a link": str(tmp_path / "link"), "as a relative path": "."}.get(listed)
    if here:  # as `python -m` puts it there, or PYTHONPATH
        monkeypatch.setattr(sys, "path", [*sys.path, here] if listed == "as a relative path" else [here, *sys.path])
    assert "no.ply" in ask_for_no_scan()["error"]


def test_a_child_starts_where_the_working_folder_is_the_engines_own(monkeypatch):
    monkeypatch.chdir(REPO)
    assert "no.ply" in ask_for_no_scan()["error"]


@pytest.mark.skipif(os.name == "nt", reason="a folder in use cannot be removed")
def test_a_child_starts_in_a_folder_that_is_no_more(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert "no.ply" in ask_for_no_scan()["error"]


def test_the_search_path_is_made_of_folders_that_mean_the_same_everywhere(tmp_path, monkeypatch):
    elsewhere = tmp_path / "packages"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", ".", "packages", str(tmp_path), str(elsewhere), str(tmp_path / f"a{os.pathsep}b")])
    assert search_path(REPO / "core").split(os.pathsep) == [str(REPO), str(elsewhere)]


def test_last_words_are_those_of_the_child():
    child = Child("no_such_module")
    assert child.last_words().startswith("exit code 1")
    assert "no_such_module" in child.last_words()
    child.close()
    child.close()


def test_the_answer_is_the_workers_own(tmp_path):
    """A scan that is none: what comes back is the sentence, and nothing that belongs to the wire."""
    (tmp_path / "text.ply").write_text("words")
    channel = Channel(Child("batch.worker"))
    answer, arrays = channel.ask({"scene": str(tmp_path / "text.ply"), "settings": {}}, limit_s=60)
    channel.close()
    assert list(answer) == ["error"]
    assert arrays == []
    json.dumps(answer)
