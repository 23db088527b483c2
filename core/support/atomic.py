"""Files that are either the old one or the whole new one, never half of either."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

PART = ".part"
# A file that nobody has written to for so long is not being written.
ABANDONED_S = 3600.0


@contextmanager
def atomic_write(path: str | Path, mode: str = "w", *, one_of_many: bool = False, lasting: bool = True) -> Iterator[IO[Any]]:
    """A file to write to, which takes the place of `path` when the block ends well and vanishes when it does not.

    `mode` is "w" (UTF-8 text) or "wb". A link stays one, and the file that it leads to is replaced; an old file's permissions
    stay, a new file gets the usual ones. OSError passes through. What a process that was killed once left of `path` half
    written is removed, but where it is `one_of_many` files of a folder, whose listing for each of them would take long.
    `lasting` False: after a loss of power the file may be neither the old one nor the new one; for large files that whoever
    reads them checks.
    """
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    part = part_of(target)
    # 0o666 less what the process's umask takes away, as for any file that is opened
    handle = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, mode, encoding=None if "b" in mode else "utf-8") as file:
            yield file
            file.flush()
            if lasting:
                os.fsync(file.fileno())
        with contextlib.suppress(FileNotFoundError):
            os.chmod(part, stat.S_IMODE(target.stat().st_mode))
        os.replace(part, target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    if not one_of_many:
        remove_old_parts(target)


def part_of(path: str | Path) -> Path:
    """A new name for a file of use while `path` is made, which `remove_parts` removes where a killed process left it."""
    target = Path(os.path.realpath(path))
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}{PART}")


def check_writable(path: str | Path) -> None:
    """Raises OSError where `atomic_write` could not write `path`, as far as that can be told before; changes nothing."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    folder = next(parent for parent in target.parents if parent.exists())
    with tempfile.TemporaryFile(dir=folder):  # Permissions alone do not tell: file systems can be read-only, or full.
        pass


def remove_parts(path: Path) -> None:
    """Removes what killed processes left of `path` half written. Only for one who knows that nobody is writing it now."""
    target = Path(os.path.realpath(path))
    with contextlib.suppress(OSError):
        for part in list(target.parent.iterdir()):
            if _is_part(part, target):
                part.unlink(missing_ok=True)


def remove_old_parts(path: Path) -> None:
    """As `remove_parts`, where others may be writing `path`: only parts much older than the file, which was just written."""
    target = Path(os.path.realpath(path))
    with contextlib.suppress(OSError):
        # The file's own time, because the clock of this machine may be wrong, or another than the folder's.
        now = target.stat().st_mtime
        for part in list(target.parent.iterdir()):
            if _is_part(part, target) and now - part.stat().st_mtime > ABANDONED_S:
                part.unlink(missing_ok=True)


def _is_part(path: Path, target: Path) -> bool:
    return path.name.startswith(f".{target.name}.") and path.name.endswith(PART)


def sync_folder(folder: Path) -> None:
    """Makes new names in `folder` last through a loss of power, where the system knows how."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
