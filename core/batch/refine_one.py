"""One photo refined from files: shared by `refine`, `demo` and the workers of `batch`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..geometry.camera import Camera
from ..geometry.pinhole_cut import WideCamera
from ..photos.fit import fit_camera
from ..photos.mask import masked
from ..photos.photo import Photo, read_photo
from ..pose.refine import refine
from ..pose.report import RefineProgress, RefineReport
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer
from .refine_wide import WideRefinement


def read_masked_photo(photo: Path, mask: Path | None) -> Photo:
    """The photo of a file, under the mask of another one where there is one. Raises PhotoError."""
    return read_photo(photo) if mask is None else masked(read_photo(photo), mask)


def refine_photo(
    renderer: ViewRenderer,
    photo: Photo,
    camera: Camera,
    settings: RefineSettings,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Fits the camera to the photo and refines it. Raises the GssmcError of whatever cannot be used."""
    if isinstance(camera, WideCamera):
        return WideRefinement(renderer, settings).run(photo, camera, on_progress)
    return refine(renderer, photo, fit_camera(photo, camera), settings, on_progress)
