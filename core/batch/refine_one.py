"""One photo refined from files: shared by `refine`, `demo` and the workers of `batch`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..geometry.camera import Camera
from ..photos.mask import masked
from ..photos.photo import Photo, check_size, read_photo
from ..pose.refine import refine
from ..pose.report import RefineProgress, RefineReport
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer


def refine_photo(
    renderer: ViewRenderer,
    photo: Photo | Path,
    camera: Camera,
    settings: RefineSettings,
    on_progress: Callable[[RefineProgress], None] | None = None,
    mask: Path | None = None,
) -> RefineReport:
    """Read the photo and its mask, fit the camera to its size, refine. Raises the GssmcError of whatever cannot be used."""
    if isinstance(photo, Path):
        photo = read_photo(photo)
    if mask is not None:
        photo = masked(photo, mask)
    fitted = replace(camera, intrinsics=check_size(photo, camera.intrinsics))
    return refine(renderer, photo, fitted, settings, on_progress)
