"""A scan prepared for drawing, in one file that processes map: the renderer's tables, and what else is asked of a scan.

The file: a line of JSON (the head) and zeros up to HEAD_BYTES, then the tables' block, then some of the Gaussians. The head has
a digest of itself and the sums of all 64-bit words that follow, so that a file that was cut off or changed is known.
"""

from __future__ import annotations

import hashlib
import json
import mmap
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import GssmcError
from ...splats.scene import GaussianScene
from ..tables import SceneTables, TablesFile, build_tables
from ..view import RenderSettings

Float32Array = NDArray[np.float32]

FORMAT, VERSION = "gssmc-scan", 2
HEAD_BYTES = 1 << 16
# So many of the Gaussians, or up to twice as many, are kept as they are in the file.
SAMPLE = 20_000
READ_BYTES = 1 << 23
MASK = (1 << 64) - 1
SCENE_FACTS = ("dropped", "normalised", "format", "orientation", "antialiased", "origin")


class PreparedFileError(GssmcError):
    """The file of a prepared scan is damaged or of another version; prepare the scan again."""


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """A scan for drawing. tables: what the renderer takes; near: the near plane that fits the scan, scene units; count: its
    Gaussians; sample: evenly chosen ones of them without view-dependent colour, with all that is said of the scan itself
    (origin, format, dropped, ...).
    """

    tables: SceneTables
    near: float
    count: int
    sample: GaussianScene

    @classmethod
    def of(cls, scene: GaussianScene, threads: int = 1) -> PreparedScan:
        """Prepares a scan that is in memory."""
        every = slice(None, None, max(1, len(scene) // SAMPLE))
        parts = (scene.means, scene.scales, scene.rotations, scene.opacities, scene.sh[:, :1])
        facts = {name: getattr(scene, name) for name in SCENE_FACTS}
        m, s, r, o, h = (np.ascontiguousarray(part[every]) for part in parts)
        sample = GaussianScene(m, s, r, o, h, **facts)
        return cls(build_tables(scene, threads), RenderSettings.for_scene(scene).near, len(scene), sample)

    def settings(self, threads: int = 0) -> RenderSettings:
        """As `RenderSettings.for_scene` of the whole scan."""
        return RenderSettings(self.near, threads)


def write_prepared(file: IO[bytes], key: str, scan: PreparedScan) -> None:
    """Writes the scan to an empty file; `key` says which scan it is. Raises OSError."""
    block, sample = scan.tables.block, _packed(scan.sample)
    head = {
        "format": FORMAT,
        "version": VERSION,
        "key": key,
        "shape": block.shape,
        "sampled": sample.shape,
        "origin": scan.tables.origin.tolist(),
        "near": scan.near,
        "count": scan.count,
        "sums": [_sum(block.ravel()), _sum(sample.ravel())],
        "facts": {name: getattr(scan.sample, name) for name in SCENE_FACTS},
    }
    file.write(_line(head).ljust(HEAD_BYTES, b"\0"))
    for part in (block, sample):
        file.write(part.reshape(-1).view(np.uint8).data)


def read_prepared(path: Path, key: str) -> PreparedScan:
    """The scan in the file, its tables mapped. Raises PreparedFileError where that is not what was written under `key`, and
    OSError.
    """
    with open(path, "rb") as file:
        head = _head(file.read(HEAD_BYTES), path)
        if head["key"] != key:
            raise PreparedFileError(f"'{path}' holds another scan than its name says; it is prepared again.")
        (rows, count), sampled = head["shape"], head["sampled"]
        sums = [_sum_of_next(file, 4 * rows * count), _sum_of_next(file, 4 * sampled[0] * sampled[1])]
        if sums != head["sums"]:
            raise PreparedFileError(f"The prepared scan in '{path}' is damaged; it is prepared again.")
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    block = np.frombuffer(mapped, np.float32, rows * count, HEAD_BYTES).reshape(rows, count)
    sample = np.frombuffer(mapped, np.float32, offset=HEAD_BYTES + block.nbytes).reshape(sampled)
    facts = {**head["facts"], "origin": tuple(head["facts"]["origin"])}
    origin, place = np.array(head["origin"]), TablesFile(str(path), HEAD_BYTES)
    tables = SceneTables(origin, block, facts["antialiased"], place)
    return PreparedScan(tables, head["near"], head["count"], _unpacked(sample, facts))


def _line(head: dict[str, Any]) -> bytes:
    text = json.dumps(head)
    return json.dumps([text, hashlib.sha256(text.encode()).hexdigest()]).encode()


def _head(raw: bytes, path: Path) -> dict[str, Any]:
    try:
        text, digest = json.loads(raw.rstrip(b"\0"))
        if hashlib.sha256(text.encode()).hexdigest() != digest:
            raise ValueError("the head was changed")
        head: dict[str, Any] = json.loads(text)
    except (ValueError, TypeError, AttributeError):
        raise PreparedFileError(f"The prepared scan in '{path}' is damaged; it is prepared again.") from None
    if (head.get("format"), head.get("version")) != (FORMAT, VERSION):
        raise PreparedFileError(f"The prepared scan in '{path}' is of another version; it is prepared again.")
    return head


def _sum(values: Float32Array) -> int:
    """The sum of 64-bit words of an array (n,), modulo 2^64; of an odd number of values the last one is a word of its own."""
    whole = len(values) // 2 * 2
    words = int(values[:whole].view(np.uint64).sum(dtype=np.uint64))
    return (words + int(values[whole:].view(np.uint32).sum(dtype=np.uint64))) & MASK


def _sum_of_next(file: IO[bytes], size: int) -> int:
    """As `_sum`, of the next `size` bytes of a file, which may end before; -1 then."""
    buffer, total = np.empty(READ_BYTES // 4, np.float32), 0
    while size:
        part = memoryview(buffer).cast("B")[: min(size, READ_BYTES)]
        if file.readinto(part) < len(part):  # type: ignore[attr-defined]
            return -1
        total += _sum(buffer[: len(part) // 4])
        size -= len(part)
    return total & MASK


def _packed(scene: GaussianScene) -> Float32Array:
    parts = (scene.means, scene.scales, scene.rotations, scene.opacities[:, None], scene.sh[:, 0])
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def _unpacked(rows: Float32Array, facts: dict[str, Any]) -> GaussianScene:
    parts = (rows[:, :3], rows[:, 3:6], rows[:, 6:10], rows[:, 10], rows[:, 11:].reshape(-1, 1, 3))
    m, s, r, o, h = (np.array(part, order="C") for part in parts)
    return GaussianScene(m, s, r, o, h, **facts)
