"""Streamed SOG: a folder whose lod-meta.json says which Gaussians of which scenes make up each level of detail.

Every leaf of its tree names, for each level, a file and a run of Gaussians in it. Level 0 is the finest. A level is a whole
scan, together with the "environment" around it, where there is one. The scenes are SOG scenes like any other.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...errors import SplatFormatError
from ...support.words import counted
from ..activate import SceneBuilder
from ..format import Progress, SplatFormat, SplatInfo
from ..scene import SH_COEFFICIENTS, GaussianScene
from .container import LARGEST_META, STREAMED, open_files
from .reader import CHUNK_ROWS, ORIENTATION, SogLayout, SogPictures

NAME = "streamed sog"
FAULTS = (KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError)
MAX_LEVELS, MAX_FILES, MAX_RUNS = 64, 1 << 16, 1 << 20

Run = tuple[int, int]  # the number of the first Gaussian, and how many


def detect(header: bytes) -> bool:
    """Whether a file begins as a lod-meta.json."""
    return header.lstrip()[:1] == b"{" and b'"lodLevels"' in header and b'"filenames"' in header


def is_folder(path: Path) -> bool:
    """Whether a folder holds a streamed scene, and not a whole one."""
    return (path / STREAMED).is_file()


def inspect(path: str | Path, level: int = 0) -> SplatInfo:
    """What the files say of one level. Raises SplatFormatError."""
    content = _Content(Path(path))
    runs = content.runs(level)
    with ExitStack() as stack:
        layouts = [_layout(stack, content.folder / name) for name in runs]
    count = sum(length for own in runs.values() for _, length in own)
    degrees = [degree for _, degree in layouts]
    return SplatInfo(content.title(level), count, max(degrees), ORIENTATION)


def read(path: str | Path, progress: Progress | None = None, level: int = 0) -> GaussianScene:
    """One level of the scene. `progress` is called with a fraction 0..1 and may raise to stop the reading.

    Raises SplatFormatError, and OSError from the file system.
    """
    content = _Content(Path(path))
    runs = content.runs(level)
    with ExitStack() as stack:
        layouts = [_layout(stack, content.folder / name) for name in runs]
    for (name, own), (layout, _) in zip(runs.items(), layouts, strict=True):
        if any(first < 0 or length < 0 or first + length > layout.count for first, length in own):
            raise SplatFormatError(f"The streamed SOG scene asks for more Gaussians than '{name:.60}' holds; export it again.")
    count = sum(length for own in runs.values() for _, length in own)
    builder = SceneBuilder(count, SH_COEFFICIENTS[max(degree for _, degree in layouts)])
    for name, own in runs.items():
        with open_files(content.folder / name) as files:
            _add(builder, SogPictures(files, SogLayout(files.meta())), own)
        if progress is not None:
            progress(builder.filled / count)
    antialiased = all(layout.antialiased for layout, _ in layouts)
    return builder.scene(content.title(level), ORIENTATION, antialiased=antialiased)


def levels(path: Path) -> int:
    """How many levels the scene has. Raises SplatFormatError."""
    return _Content(path).levels


def _layout(stack: ExitStack, path: Path) -> tuple[SogLayout, int]:
    """A scene's layout, whose pictures are large enough for what it promises, and its SH degree."""
    files = stack.enter_context(open_files(path))
    layout = SogLayout(files.meta())
    files.check_size(layout.files("means", 2)[0], layout.count)
    return layout, layout.degree(files)


def _add(builder: SceneBuilder, pictures: SogPictures, runs: list[Run]) -> None:
    for first, length in runs:
        for start in range(first, first + length, CHUNK_ROWS):
            *rows, sh = pictures.rows(slice(start, min(start + CHUNK_ROWS, first + length)))
            lacking = builder.coefficients - sh.shape[1]
            means, scales, rotations, opacities = rows
            builder.add_activated(means, scales, rotations, opacities, np.pad(sh, ((0, 0), (0, lacking), (0, 0))))


class _Content:
    """What lod-meta.json says. Raises SplatFormatError."""

    def __init__(self, path: Path) -> None:
        file = path / STREAMED if path.is_dir() else path
        self.folder = file.parent
        if file.stat().st_size > LARGEST_META:
            raise self._fault()
        try:
            self._json = json.loads(file.read_bytes().decode("utf-8-sig"))
            self.levels = int(self._json["lodLevels"])
            self._names = [str(name) for name in self._json["filenames"]]
        except FAULTS:
            raise self._fault() from None
        if not 0 < self.levels <= MAX_LEVELS or not 0 < len(self._names) <= MAX_FILES:
            raise self._fault()

    def title(self, level: int) -> str:
        return f"{NAME}, level {level} of {self.levels}"

    def runs(self, level: int) -> dict[str, list[Run]]:
        """The runs of a level by their files, within the folder."""
        if not 0 <= level < self.levels:
            raise SplatFormatError(
                f"The streamed SOG scene has {counted(self.levels, 'level')}, 0 the finest; there is no level {level}."
            )
        found: dict[str, list[Run]] = {}
        try:
            for number, first, count in self._leaves(level):
                found.setdefault(_inside(self._names[number]), []).append((first, count))
            environment = self._json.get("environment")
        except (*FAULTS, IndexError):
            raise self._fault() from None
        if isinstance(environment, str) and environment:
            with open_files(self.folder / _inside(environment)) as files:
                found.setdefault(_inside(environment), []).append((0, SogLayout(files.meta()).count))
        if not any(count for own in found.values() for _, count in own):
            raise SplatFormatError(f"Level {level} of the streamed SOG scene holds no Gaussians; choose another.")
        return found

    def _leaves(self, level: int) -> Iterator[tuple[int, int, int]]:
        """File, first Gaussian and count of each run of a level."""
        waiting, seen = [self._json["tree"]], 0
        while waiting:
            node: dict[str, Any] = waiting.pop()
            seen += 1
            if seen > MAX_RUNS:
                raise ValueError
            waiting.extend(reversed(node.get("children") or []))
            run = (node.get("lods") or {}).get(str(level))
            if run is not None:
                file, first, count = (int(run[key]) for key in ("file", "offset", "count"))
                if min(file, first, count) < 0:
                    raise ValueError
                yield file, first, count

    def _fault(self) -> SplatFormatError:
        return SplatFormatError(
            f"The {STREAMED} of the streamed SOG scene is damaged; copy the whole folder or export it again."
        )


def _inside(name: str) -> str:
    """The name of a file in the folder. Raises ValueError where it leads out of it."""
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or name.startswith("/") or "\\" in name or ":" in name or "\0" in name:
        raise ValueError
    return name


FORMAT = SplatFormat(NAME, STREAMED, ORIENTATION, detect, inspect, read)
