"""Files that a command is to write, checked against those that it reads: nobody's photo or scan may be overwritten."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..errors import UsageError


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | Iterable[Path] | None]) -> None:
    """`outputs`: what each file to be written is called ("--out"), None where it was not asked for; `inputs`: in words, the
    files that are read ("the scan"). Raises UsageError when one is the other, however it is spelt or linked.
    """
    read = [(words, one) for words, paths in inputs.items() for one in _each(paths)]
    names = {_name(path): words for words, path in read}
    files = {found: words for words, path in read if (found := _file(path)) is not None}
    for flag, path in outputs.items():
        if path is None:
            continue
        same = names.get(_name(path)) or files.get(_file(path) or (0, 0))
        if same:
            raise UsageError(f"{flag} '{path}' would overwrite {same}; give another file.")
        names[_name(path)] = f"what {flag} writes"


def _each(paths: Path | Iterable[Path] | None) -> Iterable[Path]:
    if paths is None:
        return ()
    return (paths,) if isinstance(paths, Path) else paths


def _name(path: Path) -> str:
    return os.path.normcase(os.path.realpath(path))


def _file(path: Path) -> tuple[int, int] | None:
    """What tells the file from all others, also under another name; None when there is none."""
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_dev, state.st_ino
