"""What every splat format offers, and what is known of a file before its Gaussians are read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..geometry.conventions import Orientation
from .scene import GaussianScene

Progress = Callable[[float], None]


@dataclass(frozen=True)
class SplatInfo:
    """A file's header in words: `format` as in GaussianScene, `count` Gaussians promised, `sh_degree` 0..3 as it is read.

    `orientation` is which way the axes point by the convention of the format, or as the file itself says: `declared`.
    """

    format: str
    count: int
    sh_degree: int
    orientation: Orientation
    declared: bool = False


@dataclass(frozen=True)
class SplatFormat:
    """One file format. `detect` judges a file's first bytes; `inspect` and `read` raise SplatFormatError, and OSError.

    `read` calls its second argument, where there is one, with a fraction 0..1; it may raise to stop the reading.
    `orientation` is the convention of the format; a file may declare another (SplatInfo, GaussianScene).
    """

    name: str
    suffix: str
    orientation: Orientation
    detect: Callable[[bytes], bool]
    inspect: Callable[[Path], SplatInfo]
    read: Callable[[Path, Progress | None], GaussianScene]
