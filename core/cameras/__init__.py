"""Data sets in: one module per layout, asked in this order. Poses leave through `pose_list`, `colmap` and `nerfstudio`."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import DatasetError
from . import cambridge, camera_json, colmap, inria, nerfstudio, pose_list, seven_scenes
from .files import StartCamera
from .names import match_names
from .types import PosedFrame, PoseSet, QueryPhoto, Split, short
from .unplaced import read_wanted

log = logging.getLogger(__name__)

__all__ = [
    "LAYOUTS",
    "Layout",
    "PoseSet",
    "PosedFrame",
    "QueryPhoto",
    "Split",
    "detect",
    "match_names",
    "queries",
    "read",
    "short",
    "starts",
]


@dataclass(frozen=True)
class Layout:
    """`detect` tells whether a path is of this layout; `read` gives its poses; `queries` its test photos, where it has photos
    with a known place on disk, for an optional focal length in pixels.
    """

    detect: Callable[[Path], bool]
    read: Callable[[Path, Split], PoseSet]
    queries: Callable[[Path, float | None], list[QueryPhoto]] | None = None


LAYOUTS: dict[str, Layout] = {
    "7scenes": Layout(seven_scenes.detect, seven_scenes.read, seven_scenes.queries),
    "cambridge": Layout(cambridge.detect, cambridge.read, cambridge.queries),
    "nerfstudio": Layout(nerfstudio.detect, nerfstudio.read),
    "inria": Layout(inria.detect, inria.read),
    "cameras": Layout(camera_json.detect, camera_json.read),
    "colmap": Layout(colmap.detect, colmap.read),
    "poses": Layout(pose_list.detect, pose_list.read),
}


def detect(path: Path) -> str | None:
    """The name of the path's layout, or None when it has none (a folder of something else, or nothing at all)."""
    return next((name for name, layout in LAYOUTS.items() if path.exists() and layout.detect(path)), None)


def read(path: Path, split: Split = "test") -> PoseSet:
    """The poses at `path`. `split` matters to layouts that have one. Raises DatasetError or CameraError."""
    return LAYOUTS[_known(path)].read(path, split)


def starts(path: Path) -> list[StartCamera]:
    """The cameras at `path`, in any layout, as starts of refinements; photos without a pose are left out, which is logged.

    Raises DatasetError or CameraError.
    """
    if _known(path) == "cameras":
        return _placed(path)
    return [StartCamera(frame.pose, frame.name, frame.intrinsics) for frame in read(path).frames]


def _placed(path: Path) -> list[StartCamera]:
    wanted = read_wanted(path)
    found = [one for one in wanted if isinstance(one, StartCamera)]
    if not found:
        raise DatasetError(f'No camera in \'{path.name}\' has a pose; give cameras with "R" and "t".')
    if len(found) < len(wanted):
        log.warning("%d of %d cameras in '%s' have no pose and are left out", len(wanted) - len(found), len(wanted), path.name)
    return found


def queries(path: Path, focal: float | None = None) -> list[QueryPhoto]:
    """The test photos of a scene folder. Raises DatasetError when it is none that brings its photos and lenses."""
    ask = LAYOUTS[_known(path)].queries
    if ask is None:
        able = ", ".join(name for name, layout in LAYOUTS.items() if layout.queries)
        raise DatasetError(f"'{path.name}' is no folder that photos can be taken from; give one of these layouts: {able}.")
    return ask(path, focal)


def _known(path: Path) -> str:
    layout = detect(path)
    if layout is None:
        if not path.exists():
            raise DatasetError(f"There is nothing at '{path}'; check the path.")
        raise DatasetError(
            f"'{path}' is no folder of poses; it should hold TestSplit.txt, dataset_test.txt, images.txt or transforms.json."
        )
    return layout
