"""A photo of a wide lens, or a panorama, refined: cut into pinhole pictures, which are refined, and read as one camera."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from ..geometry.camera import Camera
from ..geometry.pinhole_cut import PinholeCut, WideCamera, cuts_of
from ..geometry.wide_lens import WideLens
from ..photos.fit import fit_wide_camera
from ..photos.photo import Photo
from ..photos.wide.cut import CutPhoto, central_photo, cut_photo, lens_of_pixels
from ..pose.refine import refine
from ..pose.report import IterationRecord, RefineProgress, RefineReport
from ..pose.rig import Face, face_of, join_faces
from ..pose.settings import RefineSettings
from ..render.view import ViewRenderer

OnProgress = Callable[[RefineProgress], None]


class WideRefinement:
    """Refines photos of wide lenses in one scan. Their lens is a calibration, and nothing of it is solved for."""

    def __init__(self, renderer: ViewRenderer, settings: RefineSettings) -> None:
        self._renderer, self._settings = renderer, replace(settings, lens="fixed")

    def run(self, photo: Photo, camera: WideCamera, on_progress: OnProgress | None = None) -> RefineReport:
        """The report, whose camera is the photo's own. Raises the GssmcError of whatever cannot be used."""
        start = fit_wide_camera(photo, camera)
        if start.lens.is_panorama:
            return self._panorama(photo, lens_of_pixels(photo, start.lens), start, on_progress)
        made = central_photo(photo, start.lens)
        report = self._cut(made, start, on_progress)
        reasons = (*report.reasons, cut_sentence(start.lens, made.cut))
        return replace(report, camera=replace(start, pose=report.camera.pose), start=start, reasons=reasons)

    def _cut(self, made: CutPhoto, start: WideCamera, on_progress: OnProgress | None) -> RefineReport:
        camera = Camera(made.cut.intrinsics, made.cut.pose(start.pose), start.file)
        return refine(self._renderer, made.photo, camera, self._settings, on_progress)

    def _panorama(self, photo: Photo, lens: WideLens, start: WideCamera, on_progress: OnProgress | None) -> RefineReport:
        faces: list[Face] = []
        reports: list[RefineReport] = []
        cuts = cuts_of(lens)
        for number, cut in enumerate(cuts):
            report = self._cut(cut_photo(photo, lens, cut), start, _part(on_progress, cut.name, number, len(cuts)))
            faces.append(face_of(cut.name, report, cut.photo_pose(report.camera.pose)))
            reports.append(report)
        joined = join_faces(faces)
        pose = start.pose if joined.pose is None else joined.pose
        return RefineReport(
            camera=replace(start, pose=pose),
            start=start,
            verdict=joined.verdict,
            reasons=joined.reasons,
            iterations=tuple(_iterations(cuts, reports)),
            seconds=sum(report.seconds for report in reports),
            stage="faces",
            details=tuple(_details(cuts, reports)),
        )


def cut_sentence(lens: WideLens, cut: PinholeCut) -> str:
    """What was done to a photo that is matched through a cut."""
    return f"The photo was matched through a pinhole cut of {cut.degrees:.0f} degrees out of its lens {lens.model}."


def _part(on_progress: OnProgress | None, name: str, number: int, count: int) -> OnProgress | None:
    """Tells the progress of one of several parts as that of the whole."""
    if on_progress is None:
        return None
    return lambda p: on_progress(replace(p, step=f"{name}: {p.step}", fraction=(number + p.fraction) / count))


def _iterations(cuts: Iterable[PinholeCut], reports: Iterable[RefineReport]) -> Iterable[IterationRecord]:
    """The iterations of all parts, one after the other, with the photo's poses."""
    for cut, report in zip(cuts, reports, strict=True):
        yield from (replace(record, pose=cut.photo_pose(record.pose)) for record in report.iterations)


def _details(cuts: Iterable[PinholeCut], reports: Iterable[RefineReport]) -> Iterable[str]:
    """Each part's own verdict with its decisive reason, and the figures behind it."""
    for cut, report in zip(cuts, reports, strict=True):
        yield f"The part {cut.name} by itself is '{report.verdict}': {' '.join((*report.reasons[:1], *report.details))}"
