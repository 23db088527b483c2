"""GS-SMC engine: the exact camera of a photograph inside a 3D Gaussian Splatting scan. Plain Python; never imports bpy.

The names below are its public interface; docs/api.md describes them. Each is imported when it is first asked for, because the
engine starts processes of its own, and these need only a part of it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .geometry.camera import Camera, Intrinsics, Pose
    from .photos.photo import read_photo
    from .pose.refine import iterate_refinement, refine
    from .pose.report import RefineReport
    from .pose.settings import RefineSettings
    from .render.renderer import Renderer
    from .splats import read_splats

__all__ = [
    "Camera",
    "Intrinsics",
    "Pose",
    "RefineReport",
    "RefineSettings",
    "Renderer",
    "iterate_refinement",
    "read_photo",
    "read_splats",
    "refine",
]

_HOMES = {
    "Camera": "geometry.camera",
    "Intrinsics": "geometry.camera",
    "Pose": "geometry.camera",
    "RefineReport": "pose.report",
    "RefineSettings": "pose.settings",
    "Renderer": "render.renderer",
    "iterate_refinement": "pose.refine",
    "read_photo": "photos.photo",
    "read_splats": "splats",
    "refine": "pose.refine",
}


def __getattr__(name: str) -> object:
    """A public name at its first use; afterwards the module holds it. Raises AttributeError for any other name."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
