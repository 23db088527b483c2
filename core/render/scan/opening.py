"""Opening a scan for drawing: prepared once, kept in the user's cache folder, and mapped by all processes of the machine.

The folder holds at most LIMIT_BYTES; what was not used for the longest goes first. A process that finds another one preparing
the same scan waits for it. The environment variable GSSMC_SCAN_CACHE names another folder, or says "off".
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ...splats import inspect_splats, read_splats
from ...splats.digest import scan_file_digest
from ...splats.scene import SH_COEFFICIENTS
from ...support.atomic import atomic_write, remove_parts
from ...support.cache_folder import user_cache_folder
from ...support.lock import open_locked
from ..tables import ROWS
from .file import VERSION, PreparedFileError, PreparedScan, read_prepared, write_prepared

log = logging.getLogger(__name__)

SWITCH, OFF = "GSSMC_SCAN_CACHE", "off"
SUFFIX, LOCK = ".gssmc-scan", ".lock"
# Smaller scans are read in a second or two, and no process misses the memory.
LEAST_BYTES = 100_000_000
LIMIT_BYTES = 10_000_000_000
# What is left free on the disk.
SPARE_BYTES = 2_000_000_000
# How long another process may take to prepare a scan, and how often it is looked after.
WAIT_S, POLL_S = 600.0, 0.2
# More wait for memory.
MOST_THREADS = 4

Progress = Callable[[float], None]


def open_scan(path: Path, progress: Progress | None = None) -> PreparedScan:
    """The scan in the file `path`, prepared for drawing. Raises SplatFormatError, as `read_splats` does.

    Where the cache cannot be used (a small scan, no room, no folder, switched off), the scan is prepared in memory.
    """
    file = _file_for(path)
    if file is None:
        return PreparedScan.of(read_splats(path, progress))
    found = _kept(file)
    if found is not None:
        return found
    with _alone(file) as alone:
        found = _kept(file) if alone else None
        if found is None:
            found = PreparedScan.of(read_splats(path, progress), min(os.cpu_count() or 1, MOST_THREADS))
            # A scan that was replaced while it was read must not be found under its old name.
            if alone and _file_for(path) == file:
                found = _keep(file, found)
    return found


def scans_folder() -> Path | None:
    """Where prepared scans are kept; None where that is switched off."""
    said = os.environ.get(SWITCH, "")
    if said.lower() == OFF:
        return None
    return Path(said) if said else user_cache_folder() / "scans"


def _file_for(path: Path) -> Path | None:
    """Where the prepared scan of `path` belongs; None where it is not worth a file or there is no folder for it.

    Raises SplatFormatError.
    """
    folder, info = scans_folder(), inspect_splats(path)
    size = 4 * (ROWS + 3 * SH_COEFFICIENTS[info.sh_degree]) * info.count
    if folder is None or not LEAST_BYTES <= size <= LIMIT_BYTES:
        return None
    return folder / f"{scan_file_digest(path)[:32]}-{VERSION}{SUFFIX}"


def _kept(file: Path) -> PreparedScan | None:
    """What the file holds; None where there is none, or one that cannot be used, which is said and removed."""
    try:
        found = read_prepared(file, file.stem)
        os.utime(file)
    except FileNotFoundError:
        return None
    except PreparedFileError as error:
        log.warning("%s", error)
        with contextlib.suppress(OSError):
            file.unlink()
        return None
    except OSError as error:
        log.warning("The prepared scan in '%s' cannot be used (%s); the scan itself is read.", file, error.strerror or error)
        return None
    return found


def _keep(file: Path, scan: PreparedScan) -> PreparedScan:
    """Writes the scan to the file; the scan as the file holds it, or as it was where that fails."""
    try:
        _make_room(file.parent, scan.tables.block.nbytes)
        with atomic_write(file, "wb", lasting=False) as out:
            write_prepared(out, file.stem, scan)
    except OSError as error:
        log.info("the prepared scan cannot be kept in '%s' (%s)", file.parent, error.strerror or error)
        return scan
    return _kept(file) or scan


def _make_room(folder: Path, size: int) -> None:
    """Removes files of scans, the one that was not used for the longest first, until the folder and the disk take `size` bytes
    more; and what killed processes left. Raises OSError where the disk has too little room even then.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for lock in folder.glob(f"*{SUFFIX}{LOCK}"):
        _tidy(lock)
    files = sorted(folder.glob(f"*{SUFFIX}"), key=lambda one: one.stat().st_mtime)
    total = sum(one.stat().st_size for one in files)
    while files and (total + size > LIMIT_BYTES or shutil.disk_usage(folder).free < size + SPARE_BYTES):
        oldest = files.pop(0)
        total -= oldest.stat().st_size
        oldest.unlink()
    if shutil.disk_usage(folder).free < size + SPARE_BYTES:
        raise OSError("the disk is nearly full")


def _tidy(lock: Path) -> None:
    """Removes a lock that nobody holds, and what its holder left half written."""
    with contextlib.suppress(OSError):
        handle = open_locked(lock)
        if handle is not None:
            remove_parts(lock.with_name(lock.name.removesuffix(LOCK)))
            _release(lock, handle)


@contextmanager
def _alone(file: Path) -> Iterator[bool]:
    """Whether this process is the one that prepares the scan of `file`. Waits where another one is at it; False where that
    takes too long, or the file system knows no locks.
    """
    lock, handle, began = file.with_name(file.name + LOCK), None, time.monotonic()
    with contextlib.suppress(OSError):
        lock.parent.mkdir(parents=True, exist_ok=True)
        while (handle := open_locked(lock)) is None and time.monotonic() - began < WAIT_S:
            time.sleep(POLL_S)
    try:
        yield handle is not None
    finally:
        if handle is not None:
            remove_parts(file)
            _release(lock, handle)


def _release(lock: Path, handle: int) -> None:
    # Removed while it is held, so that no other process holds a file that is gone; Windows removes no file that is open.
    if os.name == "posix":
        lock.unlink(missing_ok=True)
        os.close(handle)
    else:
        os.close(handle)
        with contextlib.suppress(OSError):
            lock.unlink()
