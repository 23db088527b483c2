"""From the world of the cameras among the means of a scan, and back into the coordinates of its file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..cameras.training_world import Axes, ScanAxes
from ..geometry.camera import Camera

Origin = Sequence[float]


def starts_in_scene(camera: Camera, scan: ScanAxes, axes: Axes, origin: Origin) -> list[tuple[Camera, str]]:
    """The starts to try for a camera, as `ScanAxes.starts` gives them, among the means of the scene."""
    return [(start.relative_to(origin), sentence) for start, sentence in scan.starts(camera, axes)]


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
