"""What a track found, in a file, so that one that was interrupted goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CameraError
from ..geometry.camera import Pose
from ..pose.shared.least_squares import NormalEquations
from ..support.arrays_file import read_arrays
from ..support.atomic import atomic_write
from .evidence import Evidence
from .problem import Link
from .walk import PartialTrack, Tie

FORMAT = 2
HEAD = "head"
READ_ERRORS = (OSError, ValueError, KeyError, TypeError, CameraError)
Arrays = Mapping[str, NDArray[Any]]


def write_found(path: Path, found: PartialTrack, key: str) -> None:
    """Writes what was found in one step; `key` stands for everything that it depends on. Raises OSError."""
    ties, links = found.ties, found.links
    lost = {str(frame): reason for frame, reason in found.lost.items()}
    head = json.dumps({"format": FORMAT, "key": key, "lost": lost}).encode()
    poses = [tie.pose for tie in ties.values()]
    arrays = {
        HEAD: np.frombuffer(head, np.uint8),
        "frames": np.array(list(ties), np.int64),
        "R": np.array([pose.R for pose in poses]).reshape(-1, 3, 3),
        "t": np.array([pose.t for pose in poses]).reshape(-1, 3),
        "cells": np.array([tie.cells for tie in ties.values()], np.int64),
        "depth": np.array([tie.median_depth for tie in ties.values()]),
        "grow": np.array([tie.grow for tie in ties.values()]),
        "links": np.array([(link.a, link.b) for link in links], np.int64).reshape(-1, 2),
        **_packed("tie", [tie.evidence for tie in ties.values()]),
        **_packed("link", [link.evidence for link in links]),
    }
    with atomic_write(path, "wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def is_other_file(path: Path) -> bool:
    """Whether there is a file at `path` that is no journal of a track."""
    if not path.exists():
        return False
    try:
        return "format" not in _head(read_arrays(path, HEAD.__eq__))
    except READ_ERRORS:
        return True


def read_found(path: Path, key: str) -> PartialTrack:
    """What an earlier track found under the same `key`; empty where there is none, or the file is of something else."""
    try:
        head = _head(read_arrays(path, HEAD.__eq__))
        if head["format"] != FORMAT or head["key"] != key:
            return PartialTrack()
        return _found(read_arrays(path), {int(frame): str(reason) for frame, reason in head["lost"].items()})
    except READ_ERRORS:
        return PartialTrack()


def _head(arrays: Arrays) -> Any:
    return json.loads(arrays[HEAD].tobytes())


def _found(arrays: Arrays, lost: dict[int, str]) -> PartialTrack:
    columns = [arrays[name].tolist() for name in ("frames", "cells", "depth", "grow")]
    poses = [Pose.as_it_is(R, t) for R, t in zip(arrays["R"], arrays["t"], strict=True)]
    rows = zip(*columns, poses, _unpacked("tie", arrays), strict=True)
    ties = {frame: Tie(pose, evidence, cells, depth, grow) for frame, cells, depth, grow, pose, evidence in rows}
    pairs = zip(arrays["links"].tolist(), _unpacked("link", arrays), strict=True)
    return PartialTrack(ties, [Link(a, b, evidence) for (a, b), evidence in pairs], lost)


def _packed(name: str, evidence: Sequence[Evidence]) -> dict[str, NDArray[Any]]:
    out: dict[str, NDArray[Any]] = {f"{name}_matches": np.array([e.matches for e in evidence], np.int64)}
    for part in ("equations", "pixels"):
        of = [getattr(e, part) for e in evidence]
        out[f"{name}_{part}_cost"] = np.array([e.cost for e in of])
        out[f"{name}_{part}_gradient"] = np.array([e.gradient for e in of])
        out[f"{name}_{part}_information"] = np.array([e.information for e in of])
    return out


def _unpacked(name: str, arrays: Arrays) -> list[Evidence]:
    def part(which: str) -> list[NormalEquations]:
        columns = [arrays[f"{name}_{which}_{what}"] for what in ("cost", "gradient", "information")]
        return [NormalEquations(float(c), g, i) for c, g, i in zip(*columns, strict=True)]

    counts = arrays[f"{name}_matches"].tolist()
    return [Evidence(e, p, n) for e, p, n in zip(part("equations"), part("pixels"), counts, strict=True)]
