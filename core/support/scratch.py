"""A folder for files that are of use only while this process runs, removed by the next one where this one could not."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
import threading
import time
from pathlib import Path

from .lock import open_locked

PREFIX = "gssmc-scratch-"
# The file in a folder whose lock says that its process lives. A folder without this file is not one of ours.
HELD = "held"
# A younger folder may be one whose lock is just being taken.
GRACE_S = 60.0


class ScratchFolder:
    """A new folder among the system's temporary files, for files without subfolders. Folders of processes that were killed are
    removed first.
    """

    def __init__(self) -> None:
        """Raises OSError."""
        _remove_leftovers(Path(tempfile.gettempdir()))
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
        self._guard = threading.Lock()  # of the next
        self._lock: int | None = None
        try:
            self._lock = open_locked(self.path / HELD)
        except OSError:
            self.remove()
            raise

    def remove(self) -> None:
        """Removes files and folder, unless the system keeps one that is in use; then all stays until this is called again, or
        the next process comes. Any thread; harmless when repeated.
        """
        with self._guard, contextlib.suppress(OSError):
            for file in list(self.path.iterdir()):
                if file.name != HELD:
                    file.unlink()
            lock, self._lock = self._lock, None
            if lock is not None:
                os.close(lock)
            shutil.rmtree(self.path, ignore_errors=True)


def _remove_leftovers(parent: Path) -> None:
    for folder in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # another user's, or gone meanwhile
            if _is_left_over(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _is_left_over(folder: Path) -> bool:
    state = folder.lstat()
    ours = not hasattr(os, "getuid") or state.st_uid == os.getuid()
    if not ours or not stat.S_ISDIR(state.st_mode) or not (folder / HELD).is_file() or time.time() - state.st_mtime < GRACE_S:
        return False
    lock = open_locked(folder / HELD)
    if lock is None:
        return False
    os.close(lock)
    return True
