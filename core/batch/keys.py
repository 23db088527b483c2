"""What the answer to a query depends on, as a short digest: equal keys mean that it need not be found again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..cameras.files import StartCamera
from ..cameras.unplaced import Unplaced, wanted_to_dict
from ..geometry.camera import Camera
from ..pose.settings import RefineSettings
from ..splats.digest import BLOCK_BYTES, BLOCKS, scan_file_digest

__all__ = ["BLOCKS", "BLOCK_BYTES", "BatchQuery", "Refused", "key_of", "query_keys", "scan_file_digest", "stamp"]

KEY_VERSION = 5  # to be raised when the same input gets other answers, or records another form

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
    """A start camera, or what is known of one without a pose, its photo's file, and its mask's where it has one."""

    camera: Camera | Unplaced | Refused
    photo: Path
    mask: Path | None = None


def query_keys(scan: Path, queries: Sequence[BatchQuery], settings: RefineSettings, finding: str = "") -> list[str]:
    """Per query, the digest of the scan's content, of what the photo and mask are now, of the settings with the model files
    they name, and of the start. `finding`: a word for how photos are found without a start, "" where they are not. Two equal
    queries share a key, and then an answer. Raises SplatFormatError.
    """
    options = {name: value for name, value in asdict(settings).items() if name != "threads"}
    models = [stamp(Path(name)) if name else None for name in (settings.model, settings.matcher_model)]
    common = (KEY_VERSION, scan_file_digest(scan), options, models, finding)
    return [
        key_of(common, _given(q), str(q.photo), stamp(q.photo), str(q.mask or ""), q.mask and stamp(q.mask)) for q in queries
    ]


def _given(query: BatchQuery) -> dict[str, Any]:
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
