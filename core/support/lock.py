"""Files that one process at a time holds. The system lets go of them when the process ends, however it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Windows keeps others from reading what is locked. Hence a byte far behind the content is locked.
FAR = 0x7FFFFFF0


def open_locked(path: Path) -> int | None:
    """The descriptor of the file `path`, made where it is missing and opened for reading and appending, which no other process
    or thread can open so until it is closed; None when another holds it. Children do not inherit it.

    Raises OSError when the file cannot be opened, or the file system knows no locks.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
        try:
            if not _lock(handle):
                os.close(handle)
                return None
            if is_at(handle, path):
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # whoever held it has removed it meanwhile


def is_at(handle: int, path: Path) -> bool:
    """Whether the open file is the one that is found at `path`."""
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> bool:
        """Whether the lock is ours."""
        os.lseek(handle, FAR, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        finally:
            os.lseek(handle, 0, os.SEEK_SET)
        return True

else:
    import fcntl

    def _lock(handle: int) -> bool:
        """Whether the lock is ours."""
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
