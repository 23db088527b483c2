"""Cameras that are known beside a scan: they saw what the splat was trained on, so that maps begin with them."""

from __future__ import annotations

import math
from pathlib import Path

from ..errors import DatasetError
from ..geometry.camera import Camera, Intrinsics, Pose
from . import detect, read
from .files import load_json, start_from_dict
from .unplaced import is_unplaced

# A view of the map is drawn with any lens that sees what the photo saw: about that of a phone.
USUAL = Intrinsics(640, 480, 320 / math.tan(math.radians(30)), 320 / math.tan(math.radians(30)), 320.0, 240.0)


def read_known(path: Path) -> list[Camera]:
    """The cameras at `path`, in any layout (of the training split, where there is one), in the splat file's coordinates.

    Results of a refinement count where they are trusted. Raises DatasetError or CameraError.
    """
    if detect(path) == "cameras":
        found = _cameras(path)
    else:
        found = [(frame.name, frame.pose, frame.intrinsics) for frame in read(path, "train").frames]
    if not found:
        raise DatasetError(f"'{path}' holds no camera that is known; give cameras with poses, or trusted results.")
    return [Camera(lens or USUAL, pose, name) for name, pose, lens in found]


def _cameras(path: Path) -> list[tuple[str, Pose, Intrinsics | None]]:
    """Name, pose and lens of our own JSON's cameras, but for those whose verdict is a doubt."""
    data = load_json(path)
    records = data.get("frames", [data]) if isinstance(data, dict) else data
    if not isinstance(records, list):
        raise DatasetError(f"'{path.name}' has no list of cameras under \"frames\"; give at least one camera there.")
    out = []
    for number, record in enumerate(records, 1):
        if is_unplaced(record) or (isinstance(record, dict) and record.get("verdict", "trusted") != "trusted"):
            continue
        start = start_from_dict(record, f"Camera {number} of '{path.name}'")
        out.append((start.file, start.pose, start.intrinsics))
    return out
