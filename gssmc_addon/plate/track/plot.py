"""The small picture of a plate's errors as an icon, which panels can draw."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from bpy.utils import previews

from . import errors as frame_errors


class _Plots:
    """The pictures made so far. Icons are no data of the .blend, so they have no other place."""

    def __init__(self) -> None:
        self.previews: Any = None


_plots = _Plots()


def icon(data: bpy.types.Camera) -> int:
    """The icon of the camera's errors, made when it is first asked for; 0 where there are none."""
    errors = frame_errors.read(data)
    if not errors or _plots.previews is None:
        return 0
    key = str(hash((data.session_uid, tuple(errors.items()))))
    if key not in _plots.previews:
        picture = frame_errors.drawn(errors)[::-1].astype(np.float32) / 255  # Blender's first row is the lowest.
        preview = _plots.previews.new(key)
        height, width = picture.shape[:2]
        preview.image_size = width, height
        preview.image_pixels_float.foreach_set(np.dstack([picture, np.ones((height, width), np.float32)]).ravel())
    found: int = _plots.previews[key].icon_id
    return found


def register() -> None:
    _plots.previews = previews.new()


def unregister() -> None:
    previews.remove(_plots.previews)
    _plots.previews = None
