"""What `ns-export cameras` of nerfstudio writes: a list of photos with camera-to-world matrices in the world of the splat."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import CameraError, DatasetError
from ...geometry.conventions import pose_from_opengl
from ..files import load_json
from ..types import PosedFrame, PoseSet, Split, collect, pose_set
from .parts import FAULTS, begins


def detect(path: Path) -> bool:
    start = begins(path)
    return start.lstrip().startswith("[") and '"file_path"' in start and '"transform"' in start


def read(path: Path, split: Split = "test") -> PoseSet:
    """All cameras of the file, which tells no lenses. Raises DatasetError, CameraError."""
    records = load_json(path)
    numbered = list(enumerate(records if isinstance(records, list) else [records], 1))
    frames, bad = collect(numbered, lambda one: _frame(f"Camera {one[0]} of '{path.name}'", one[1]))
    return replace(pose_set(path, frames, metric=False, bad=bad), pixel_order="stored")


def _frame(where: str, record: Any) -> PosedFrame:
    try:
        return PosedFrame(str(record["file_path"]), pose_from_opengl(record["transform"]))
    except (*FAULTS, CameraError):
        raise DatasetError(f'{where} has no "file_path" and "transform" of a camera; export the cameras again.') from None
