"""Files that appear whole, files that one process at a time holds, and folders that go with their process."""

import os
import stat
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from core.support.atomic import atomic_write
from core.support.lock import open_locked
from core.support.scratch import GRACE_S, ScratchFolder

REPO = Path(__file__).parents[3]
POSIX = pytest.mark.skipif(os.name == "nt", reason="permissions and links of POSIX")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def killed(code):
    """Runs `code` in a process until it says so, then kills it."""
    ready = "import sys, time; print('ready', flush=True); time.sleep(600)"
    process = subprocess.Popen([sys.executable, "-c", f"{code}\n{ready}"], cwd=REPO, stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"ready\n"
    process.kill()
    process.communicate()


# ---- atomic_write


def test_the_old_file_stays_when_the_new_one_fails(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_write(path) as file:
        file.write("half of the new")
        raise RuntimeError("the power went")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    with atomic_write(path) as file:
        file.write("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"


@POSIX
def test_the_umask_is_kept_and_never_touched(tmp_path, monkeypatch):
    """It belongs to the whole process: a file that another thread makes while it is 0 can be written to by anybody."""
    before = os.umask(0o027)
    try:
        monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the umask was set"))
        with atomic_write(tmp_path / "a") as file:
            file.write("x")
    finally:
        monkeypatch.undo()
        os.umask(before)
    assert mode(tmp_path / "a") == 0o640


@POSIX
def test_a_private_file_stays_private(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    path.chmod(0o600)
    with atomic_write(path) as file:
        file.write("new")
    assert (mode(path), path.read_text()) == (0o600, "new")


@POSIX
def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "a").write_text("old")
    (tmp_path / "a").symlink_to(tmp_path / "store" / "a")
    with atomic_write(tmp_path / "a") as file:
        file.write("new")
    assert (tmp_path / "a").is_symlink()
    assert (tmp_path / "store" / "a").read_text() == "new"


# ---- open_locked


def test_only_one_holds_a_file(tmp_path):
    path = tmp_path / "l"
    handle = open_locked(path)
    assert open_locked(path) is None
    os.close(handle)
    again = open_locked(path)
    assert again is not None
    os.close(again)


def test_a_dead_process_holds_nothing(tmp_path):
    killed(
        f"from core.support.lock import open_locked\nhandle = open_locked({str(tmp_path / 'l')!r})\nassert handle is not None"
    )
    handle = open_locked(tmp_path / "l")
    assert handle is not None
    os.close(handle)


@POSIX
def test_whoever_gets_the_lock_has_the_file_that_is_there(tmp_path):
    """Holders remove it when they are done: a lock on what was removed would be worth nothing."""
    path, held, most = tmp_path / "l", [], []

    def hold():
        for _ in range(200):
            handle = open_locked(path)
            if handle is not None:
                held.append(1)
                most.append(len(held))
                held.pop()
                path.unlink()
                os.close(handle)

    threads = [threading.Thread(target=hold) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert max(most) == 1


# ---- ScratchFolder

MAKE = """
from core.support.scratch import ScratchFolder
folder = ScratchFolder()
(folder.path / "tables").write_bytes(bytes(1000))
"""


def age(folder):
    then = time.time() - 2 * GRACE_S
    os.utime(folder, (then, then))


def test_what_a_killed_process_left_is_removed_by_the_next(temporary):
    killed(MAKE)
    (left,) = temporary.iterdir()
    young = ScratchFolder()
    assert left.exists(), "its lock may just be being taken"
    age(left)
    folder = ScratchFolder()
    assert sorted(temporary.iterdir()) == sorted([young.path, folder.path])
    folder.remove()
    young.remove()
    folder.remove()
    assert not list(temporary.iterdir())


def test_folders_of_others_are_left_alone(temporary):
    alive = ScratchFolder()
    (temporary / "gssmc-scratch-notes").mkdir()
    (temporary / "gssmc-scratch-notes" / "diary.txt").write_text("mine")
    (temporary / "gssmc-results").mkdir()
    for folder in temporary.iterdir():
        age(folder)
    ScratchFolder().remove()
    assert sorted(p.name for p in temporary.iterdir()) == sorted([alive.path.name, "gssmc-results", "gssmc-scratch-notes"])
    alive.remove()


def test_what_a_killed_process_left_half_written_is_removed_when_it_is_old(tmp_path):
    path = tmp_path / "r.json"
    path.write_text("whole")
    now = path.stat().st_mtime
    names = {".r.json.0a1b.part": 7200, ".r.json.2c3d.part": 60, ".other.json.4e5f.part": 7200, "r.json.part": 7200}
    for name, age in names.items():
        (tmp_path / name).write_text("half")
        os.utime(tmp_path / name, (now - age,) * 2)
    with atomic_write(path) as file:
        file.write("whole again")
    os.utime(path, (now, now))
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["r.json", *list(names)[1:]])
