"""Splat scenes: one reader per format, one in-memory form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from ..errors import SplatFormatError
from . import ply
from .scene import GaussianScene

__all__ = ["READERS", "GaussianScene", "check_splat_file", "read_splats"]

READERS: dict[str, ModuleType] = {"ply": ply}  # each has detect(header) -> bool and read(path, progress) -> GaussianScene
DETECT_BYTES = 4096


def read_splats(path: str | Path, progress: Callable[[float], None] | None = None) -> GaussianScene:
    """The scene in the file `path`, whatever its format; `progress` is called with a fraction 0..1.

    Raises SplatFormatError with one sentence when the file is missing, unreadable or no splat scene.
    """
    path = Path(path)
    reader = check_splat_file(path)
    try:
        scene: GaussianScene = reader.read(path, progress)
        return scene
    except MemoryError:
        raise SplatFormatError(f"The splat file '{path.name}' does not fit into memory; use a smaller scan.") from None
    except OSError as error:
        raise SplatFormatError(f"The splat file '{path}' cannot be read ({error.strerror}); check its permissions.") from error


def check_splat_file(path: str | Path) -> ModuleType:
    """The reader of the file `path`, from its first bytes alone. Raises SplatFormatError as `read_splats` does."""
    path = Path(path)
    if path.is_dir():
        raise SplatFormatError(f"'{path}' is a folder; choose a splat file such as a .ply inside it.")
    try:
        with open(path, "rb") as file:
            header = file.read(DETECT_BYTES)
    except FileNotFoundError:
        raise SplatFormatError(f"There is no splat file at '{path}'; check the path.") from None
    except OSError as error:
        raise SplatFormatError(f"The splat file '{path}' cannot be read ({error.strerror}); check its permissions.") from error
    if not header:
        raise SplatFormatError(f"The splat file '{path}' is empty (0 bytes); copy or export it again.")
    reader = next((module for module in READERS.values() if module.detect(header)), None)
    if reader is None:
        raise SplatFormatError(f"'{path.name}' is not a splat file of a known format; choose a Gaussian splat .ply.")
    return reader
