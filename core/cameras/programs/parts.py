"""What the readers of these files share: numbers out of text or JSON, poses, and lenses whose photo's size comes later."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import CameraError, DatasetError
from ...geometry.camera import FloatArray, Intrinsics, Pose
from ...geometry.foreign_lens import Lens, lens_of
from ...geometry.wide_lens import WideLens
from ..text import LARGEST
from ..types import LensOfSize, PosedFrame, lens_of_file

FAULTS = (KeyError, IndexError, TypeError, ValueError, OverflowError, AttributeError, ZeroDivisionError)
HEAD_BYTES = 1 << 16


def begins(path: Path) -> str:
    """The first bytes of a file as text, whatever they are; empty for a folder and what cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES).decode("utf-8-sig", errors="replace")
    except OSError:
        return ""


def finite(values: Any, count: int) -> FloatArray:
    """`count` finite numbers of a sane size, given as numbers or as their text. Raises ValueError and the like."""
    array = np.asarray([float(value) for value in values], np.float64)
    if array.shape != (count,) or not (np.abs(array) <= LARGEST).all():
        raise ValueError
    return array


def pose_of(where: str, rotation: ArrayLike, centre: ArrayLike) -> Pose:
    """The pose with a world-to-camera rotation and a centre. Raises DatasetError, which `where` begins."""
    try:
        return Pose.from_centre(np.asarray(rotation, np.float64), centre)
    except CameraError as error:
        raise DatasetError(f"{where} cannot be used: {error}") from None


def with_lens(name: str, pose: Pose, lens: Lens) -> PosedFrame:
    return PosedFrame(name, pose, lens.intrinsics, problem=lens.problem, is_picture=lens.is_picture, wide=lens.wide)


def without_lens(name: str, pose: Pose) -> PosedFrame:
    """A frame whose record has a lens that makes none."""
    return PosedFrame(name, pose, problem="the lens is left out, for its values make none")


def foreign(model: str, pinhole: Intrinsics, values: Mapping[str, float]) -> Lens:
    """The lens of a file, of any model of `geometry.foreign_lens`. Raises CameraError where no photo has its size."""
    return lens_of(model, lens_of_file(pinhole), values)


def lens_by_size(model: str, focal: float, values: Mapping[str, float], of_long_side: bool = False) -> LensOfSize:
    """A lens with its centre in the photo's middle; `focal` in pixels, or as a share of the photo's long side. A shift of the
    centre is given as "cx" and "cy", as shares of the long side.
    """
    shift = values.get("cx", 0.0), values.get("cy", 0.0)
    others = {name: value for name, value in values.items() if name not in ("cx", "cy")}

    def at(width: int, height: int) -> Intrinsics | WideLens:
        long = max(width, height)
        f = focal * long if of_long_side else focal
        lens = foreign(
            model, Intrinsics(width, height, f, f, width / 2 + shift[0] * long, height / 2 + shift[1] * long), others
        )
        found = lens.intrinsics or lens.wide
        if found is None:
            raise CameraError(f"The photo's lens cannot be used: {lens.problem}.")
        return found

    return at
