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


@contextmanager
def atomic_write(path: str | Path, mode: str = "w", lasting: bool = True) -> Iterator[IO[Any]]:
    """A file to write to, which takes the place of `path` when the block ends well and vanishes when it does not.

    `mode` is "w" (UTF-8 text) or "wb". A link stays one, and the file that it leads to is replaced; an old file's permissions
    stay, a new file gets the usual ones. OSError passes through. `lasting` False: after a loss of power the file may be
    neither the old one nor the new one; for large files that whoever reads them checks.
    """
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}{PART}")
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
            if part.name.startswith(f".{target.name}.") and part.name.endswith(PART):
                part.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Makes new names in `folder` last through a loss of power, where the system knows how."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
