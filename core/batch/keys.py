"""What the answer to a query depends on, as a short digest: equal keys mean that it need not be found again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..cameras.files import StartCamera
from ..cameras.unplaced import Unplaced, wanted_to_dict
from ..errors import SplatFormatError
from ..geometry.camera import Camera
from ..pose.settings import RefineSettings
from ..splats.digest import BLOCK_BYTES, BLOCKS, scan_file_digest

__all__ = [
    "BLOCKS",
    "BLOCK_BYTES",
    "KEY_VERSION",
    "BatchQuery",
    "Refused",
    "check_unchanged",
    "given",
    "key_of",
    "query_keys",
    "scan_file_digest",
    "stamp",
]

KEY_VERSION = 6  # to be raised when the same input gets other answers, or records another form

Stamp = tuple[int, int] | None


@dataclass(frozen=True)
class Refused:
    """A record that is known to fail before any work: what of it could be read, and one sentence that says why."""

    given: StartCamera | Unplaced
    sentence: str

    @property
    def file(self) -> str:
        """The photo's name as the source spells it, "" where it names none."""
        return self.given.file


@dataclass(frozen=True)
class BatchQuery:
    """A start camera, or what is known of one without a pose, its photo's file, and its mask's where it has one. `seen`: what
    the two files were when the query was made, which its key stands for.
    """

    camera: Camera | Unplaced | Refused
    photo: Path
    mask: Path | None = None
    seen: tuple[Stamp, Stamp] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "seen", self._stamps())

    @property
    def is_changed(self) -> bool:
        """Whether one of the files is another one than when the query was made."""
        return self._stamps() != self.seen

    def _stamps(self) -> tuple[Stamp, Stamp]:
        return stamp(self.photo), stamp(self.mask) if self.mask else None


def query_keys(scan: Path, queries: Sequence[BatchQuery], settings: RefineSettings, finding: str = "") -> list[str]:
    """Per query, the digest of the scan's content, of what photo and mask were when it was made, of the settings with the
    model files they name, and of the start. `finding`: a word for how photos are found without a start, "" where they are not.
    Two equal queries share a key, and then an answer. Raises SplatFormatError.
    """
    options = {name: value for name, value in asdict(settings).items() if name != "threads"}
    models = [stamp(Path(name)) if name else None for name in (settings.model, settings.matcher_model)]
    common = key_of(KEY_VERSION, scan_file_digest(scan), options, models, finding)  # once, for thousands of photos
    return [key_of(common, given(q), str(q.photo), q.seen[0], str(q.mask or ""), q.seen[1]) for q in queries]


def given(query: BatchQuery) -> dict[str, Any]:
    return wanted_to_dict(query.camera.given if isinstance(query.camera, Refused) else query.camera)


def key_of(*parts: Any) -> str:
    """A short digest of `parts`, which JSON can hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def stamp(path: Path) -> Stamp:
    """Size in bytes and time of the last change, ns; None for a file that cannot be read."""
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_size, state.st_mtime_ns


def check_unchanged(scan: Path, digest: str) -> None:
    """To be called when the scan has been read: raises SplatFormatError where its `scan_file_digest`, not dated, is another one
    now, so that nothing is said of it under the name of the other. A copy on another machine is the same scan.
    """
    if scan_file_digest(scan, dated=False) != digest:
        raise SplatFormatError(f"The splat file '{scan.name}' was changed while it was being used; run the command again.")
