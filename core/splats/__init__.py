"""Splat scenes: one reader per format, one in-memory form."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import SplatFormatError
from . import gltf, ksplat, splat, usd
from .format import SplatFormat, SplatInfo
from .ply import compressed as ply_compressed
from .ply import mip as ply_mip
from .ply import reader as ply
from .ply import two_dgs as ply_2dgs
from .scene import GaussianScene
from .sog import reader as sog
from .sog import streamed
from .sog.container import META, STREAMED
from .spz import reader as spz
from .unknown import name_of

__all__ = [
    "FORMATS",
    "OTHER_SUFFIXES",
    "SUFFIXES",
    "GaussianScene",
    "SplatFormat",
    "SplatInfo",
    "check_splat_file",
    "inspect_splats",
    "read_splats",
    "scan_files",
]

# Asked in this order: the special .ply layouts before the plain one, which takes every .ply; .splat last, having no mark.
FORMATS: tuple[SplatFormat, ...] = (
    ply_compressed.FORMAT,
    ply_mip.FORMAT,
    ply_2dgs.FORMAT,
    ply.FORMAT,
    spz.FORMAT,
    usd.FORMAT,
    streamed.FORMAT,
    sog.FORMAT,
    gltf.FORMAT,
    ksplat.FORMAT,
    splat.FORMAT,
)
SUFFIXES = tuple(dict.fromkeys(found.suffix for found in FORMATS))
# How files of these formats may end besides.
OTHER_SUFFIXES = (".gltf", ".usd", ".usda", ".usdz", META)
KNOWN = ", ".join(SUFFIXES)
DETECT_BYTES = 1 << 14


def read_splats(path: str | Path, progress: Callable[[float], None] | None = None, level: int = 0) -> GaussianScene:
    """The scene in the file `path`, whose content tells its format; `progress` is called with a fraction 0..1. `level`: of a
    streamed scene, which has several; 0 is the finest.

    Raises SplatFormatError with one sentence when the file is missing, unreadable or no splat scene.
    """
    path = Path(path)
    found = check_splat_file(path)
    with _file_errors(path):
        return streamed.read(path, progress, level) if found is streamed.FORMAT else found.read(path, progress)


def inspect_splats(path: str | Path) -> SplatInfo:
    """What the file's header says, without reading the Gaussians. Raises SplatFormatError as `read_splats` does."""
    path = Path(path)
    found = check_splat_file(path)
    with _file_errors(path):
        return found.inspect(path)


def check_splat_file(path: str | Path) -> SplatFormat:
    """The format of the file `path`, from its first bytes alone. Raises SplatFormatError as `read_splats` does."""
    path = Path(path)
    if path.is_dir() and (sog.is_folder(path) or streamed.is_folder(path)):
        return sog.FORMAT if sog.is_folder(path) else streamed.FORMAT
    if path.is_dir():
        raise SplatFormatError(f"'{path}' is a folder; choose a splat file ({KNOWN}) inside it.")
    if path.suffix.lower() in (".lcc", ".lcc2") and path.is_file():
        raise SplatFormatError(
            f"'{path.name}' is an LCC scan of XGRIDS, not read here; turn it into .ply with splat-transform."
        )
    with _file_errors(path), open(path, "rb") as file:
        header = file.read(DETECT_BYTES)
    if not header:
        raise SplatFormatError(f"The splat file '{path}' is empty (0 bytes); copy or export it again.")
    found = next((one for one in FORMATS if one.detect(header)), None)
    if found is None:
        raise SplatFormatError(
            f"'{path.name}' is {name_of(header)}, not a splat file of a known format; choose a Gaussian splat ({KNOWN})."
        )
    return found


def scan_files(path: Path) -> list[Path]:
    """The files that a scan consists of: itself, or all that lie beside the meta.json of a scene in a folder, and of a streamed
    scene also those below.
    """
    folder = path if path.is_dir() else path.parent
    if streamed.is_folder(folder) and path in (folder, folder / STREAMED):
        return sorted(file for file in folder.rglob("*") if file.is_file())
    if sog.is_folder(folder) and path in (folder, folder / META):
        return sorted(file for file in folder.iterdir() if file.is_file())
    return [path]


@contextmanager
def _file_errors(path: Path) -> Iterator[None]:
    """What the file system and the memory refuse, as SplatFormatError."""
    try:
        yield
    except MemoryError:
        raise SplatFormatError(f"The splat file '{path.name}' does not fit into memory; use a smaller scan.") from None
    except FileNotFoundError:
        raise SplatFormatError(f"There is no splat file at '{path}'; check the path.") from None
    except OSError as error:
        raise SplatFormatError(f"The splat file '{path}' cannot be read ({error.strerror}); check its permissions.") from error
