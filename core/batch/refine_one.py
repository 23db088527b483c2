"""One photo refined from files: shared by `refine`, `demo` and the workers of `batch`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ..geometry.camera import Camera
from ..photos.fit import fit_camera
from ..photos.mask import masked
from ..photos.photo import Photo, read_photo
from ..pose.refine import refine
from ..pose.report import RefineProgress, RefineReport
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer


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
    return refine(renderer, photo, fit_camera(photo, camera), settings, on_progress)


def refine_starts(
    renderer: ViewRenderer,
    photo: Photo,
    starts: Sequence[tuple[Camera, str]],
    settings: RefineSettings,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Refines from one start after the other until one does not fail; a start's sentence becomes the last reason of its report.
    Where all fail, the first one's report. Raises the GssmcError of whatever cannot be used.
    """
    first: RefineReport | None = None
    for start, sentence in starts:
        report = refine_photo(renderer, photo, start, settings, on_progress)
        if report.verdict != "failed":
            return replace(report, reasons=(*report.reasons, sentence)) if sentence else report
        first = first or report
    assert first is not None, "there is no start"
    return first
