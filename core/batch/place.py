"""Answers about a scan that lies far out: found among its means, told in the coordinates of its file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..cameras.unplaced import Unplaced
from ..geometry.camera import Camera

Origin = Sequence[float]


def into_scene(wanted: Camera | Unplaced, origin: Origin) -> Camera | Unplaced:
    """A camera of the file's coordinates, among the means of the scene."""
    return wanted.relative_to(origin) if isinstance(wanted, Camera) else wanted


def record_into_scene(record: Any, origin: Origin) -> Any:
    """As `into_scene`, of a record as JSON holds it."""
    return into_file(record, [-value for value in origin])


def into_file(record: Any, origin: Origin) -> Any:
    """A record as JSON holds it, with every pose in it, "R" and "t", in the coordinates of the file."""
    if not any(origin):
        return record
    if isinstance(record, list | tuple):
        return [into_file(one, origin) for one in record]
    if not isinstance(record, dict):
        return record
    out = {key: into_file(value, origin) for key, value in record.items()}
    if out.get("R") is not None and out.get("t") is not None:
        out["t"] = (np.asarray(out["t"]) - np.asarray(out["R"]) @ np.asarray(origin)).tolist()
    return out
