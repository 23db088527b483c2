"""One photo refined from files: shared by `refine`, `demo` and the workers of `batch`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ..geometry.camera import Camera, rotation_angle_deg
from ..geometry.pinhole_cut import WideCamera
from ..photos.fit import fit_camera, other_reading
from ..photos.mask import masked
from ..photos.photo import Photo, read_photo
from ..pose.attempt import DONE, VERDICTS
from ..pose.refine import refine
from ..pose.report import RefineProgress, RefineReport
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer
from .refine_wide import WideRefinement

TURNED_DEG = 90.0
OTHER_FITS = (
    "The photo is turned by its EXIF data, and its camera was taken for one of the {said} pixels, because that fits better; "
    'say "orientation": "{said}" in the camera file.'
)
NOT_BETTER = "The photo is turned by its EXIF data; a camera of the other pixels, stored or upright, fits it no better."


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
    """Fits the camera to the photo and refines it. Raises the GssmcError of whatever cannot be used.

    Of a photo that EXIF turns by 180 degrees, no size shows whether the camera belongs to its upright or its stored pixels.
    Where what the camera says leads to no trusted result, or to one turned against its start, the other is tried as well.
    """
    if isinstance(camera, WideCamera):
        return WideRefinement(renderer, settings).run(photo, camera, on_progress)
    report = refine(renderer, photo, fit_camera(photo, camera), settings, on_progress)
    other = None if report.verdict == "trusted" and not _is_turned(report) else other_reading(photo, camera)
    if other is None:
        return report
    told = None if on_progress is None else lambda p: on_progress(replace(p, fraction=DONE + (1 - DONE) * p.fraction))
    again = refine(renderer, photo, other, settings, told)
    seconds = report.seconds + again.seconds
    if _merit(again) <= _merit(report):
        return replace(report, seconds=seconds, details=(*report.details, NOT_BETTER))
    said = "upright" if camera.pixel_order == "stored" else "stored"
    return replace(again, seconds=seconds, reasons=(*again.reasons, OTHER_FITS.format(said=said)))


def _is_turned(report: RefineReport) -> bool:
    """Whether the result looks at the scene the other way up than its start."""
    return rotation_angle_deg(report.start.pose.R.T @ report.camera.pose.R) > TURNED_DEG


def _merit(report: RefineReport) -> tuple[int, bool, int]:
    """Greater for the better of two: by the verdict, then by the start's turn, then by how much of the photo fits."""
    corners = report.quality.region_corners if report.quality else 0
    return VERDICTS.index(report.verdict), not _is_turned(report), corners


def refine_starts(
    renderer: ViewRenderer,
    photo: Photo,
    starts: Sequence[tuple[Camera, str]],
    settings: RefineSettings,
    on_progress: Callable[[RefineProgress], None] | None = None,
) -> RefineReport:
    """Refines from one start after the other until one does not fail; a start's sentence becomes the last reason of its report.
    Where all fail, the first one's report. Its seconds are those of all that was tried. Raises the GssmcError of whatever
    cannot be used.
    """
    first, seconds = None, 0.0
    for start, sentence in starts:
        report = refine_photo(renderer, photo, start, settings, on_progress)
        seconds += report.seconds
        if report.verdict != "failed":
            report = replace(report, seconds=seconds)
            return replace(report, reasons=(*report.reasons, sentence)) if sentence else report
        first = first or report
    assert first is not None, "there is no start"
    return replace(first, seconds=seconds)
