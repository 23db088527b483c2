"""Find Camera, from Blender's data and back: prepare, watch, apply."""

from __future__ import annotations

import math
import time
from functools import partial

import bpy

from ...core.geometry.camera import Camera
from ...core.locate import FindProgress, FindReport, MapSettings
from ...core.pose.report import RefineProgress
from ...core.pose.settings import RefineSettings
from ...core.render import memory
from ..camera import record as camera_record
from ..camera import solution as camera_solution
from ..jobs.machine import Job
from ..jobs.worker import RefineInputs
from ..refine import job as refine_job
from ..registration import camera_props, preferences
from ..splat import object as splat_object
from ..splat import up_axis
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.texts import iface_, n_, rpt_
from .finder import BEFORE_MAP, MAP_STEP, Finder, MapWanted, Where, as_refined, known_of
from .place import place_of

SEEN_VIEWS, SHORT_S = 3, 100  # views that must have been seen made to tell the time; a longer one is told in minutes
REFINING = 0.5  # share of the progress after which a candidate is refined


class FindJob(Job):
    """The search for one camera; its result is the FindReport."""

    status = n_("Finding the camera    Esc: cancel")

    def __init__(self, targets: refine_job.Targets, inputs: RefineInputs, finder: Finder, copying: SplatCopying) -> None:
        super().__init__(partial(finder.finding, inputs, targets.camera), copying)
        self.targets, self.inputs, self.finder = targets, inputs, finder
        self._told = Told(finder)

    def check(self) -> None:
        self.targets.find()

    def close(self) -> None:
        self.inputs.splat.close()

    def on_progress(self, news: FindProgress) -> None:
        self.fraction, self.step, self.detail = self._told(news)


class RefineOrFindJob(refine_job.RefineJob):
    """A refinement of one camera, and where that fails the search for it; its result is the RefineReport of the better one."""

    def __init__(self, targets: refine_job.Targets, inputs: RefineInputs, finder: Finder, copying: SplatCopying) -> None:
        super().__init__(targets, inputs, copying, partial(finder.found_if_failed, inputs, targets.camera))
        self._told = Told(finder)

    def on_progress(self, news: RefineProgress | FindProgress) -> None:
        if isinstance(news, RefineProgress):
            super().on_progress(news)
        else:
            self.fraction, self.step, self.detail = self._told(news)


class Told:
    """A search's progress in words: called with each step, it gives fraction, step and detail."""

    def __init__(self, finder: Finder) -> None:
        self._finder = finder
        self._views: list[tuple[float, int]] = []  # when the map was seen to have so many views; of one photo

    def __call__(self, news: FindProgress) -> tuple[float, str, str]:
        step = iface_(news.step)
        step = step[:1].upper() + step[1:]
        if news.refining is not None:
            now = news.refining
            said = iface_("Iteration {number} of {count}", number=max(now.iteration, 1), count=now.iterations)
            return news.fraction, step, said
        if news.step in BEFORE_MAP:
            self._views = []
            return 0.0, step, ""
        fraction = 0.0 if news.step == MAP_STEP else REFINING * news.fraction  # what is there already costs no time
        return fraction, step, self._map_detail(max(0, news.views - self._finder.views_before))

    def _map_detail(self, views: int) -> str:
        """Views of the map so far, and how long all of them would take: a photo that is found needs no more."""
        now = time.perf_counter()
        if not self._views or views > self._views[-1][1]:
            self._views.append((now, views))
        if views == 0:
            return iface_("Making a map of the scan, which is kept for its other photos.")
        values = {"views": views, "count": max(views, self._finder.wanted_views)}
        if views == values["count"]:
            return iface_("The map of the scan is whole; the photo is looked for in all of it.")
        drawn = [seen for seen in self._views if seen[1] > self._views[0][1]]
        if len(drawn) < SEEN_VIEWS:
            return iface_("Map of the scan: view {views} of {count}", **values)
        (began, first), (last, _) = drawn[0], drawn[-1]
        seconds = (values["count"] - views) * (last - began) / (views - first)
        if seconds < SHORT_S:
            return iface_("Map of the scan: view {views} of {count}, at most {seconds:.0f} s to go", seconds=seconds, **values)
        minutes = math.ceil(seconds / 60)
        return iface_("Map of the scan: view {views} of {count}, at most {minutes} min to go", minutes=minutes, **values)


def prepare(
    scene: bpy.types.Scene,
    splat: bpy.types.Object | None,
    camera: bpy.types.Object | None,
    settings: RefineSettings,
) -> FindJob:
    """Copies all inputs out of Blender, but for the splat, which the job does first.

    Raises GssmcError, with what to do, when something is missing or unfit.
    """
    return FindJob(*_prepared(scene, splat, camera, settings))


def prepare_refinement(
    scene: bpy.types.Scene,
    splat: bpy.types.Object | None,
    camera: bpy.types.Object | None,
    settings: RefineSettings,
) -> RefineOrFindJob:
    """As `prepare`, for a refinement that the search follows only where it fails."""
    return RefineOrFindJob(*_prepared(scene, splat, camera, settings))


def _prepared(
    scene: bpy.types.Scene,
    splat: bpy.types.Object | None,
    camera: bpy.types.Object | None,
    settings: RefineSettings,
) -> tuple[refine_job.Targets, RefineInputs, Finder, SplatCopying]:
    splat = splat_object.picked(scene, splat)
    copying = SplatCopying(splat)
    renderer = SplatRenderer(copying, settings.threads, keeps=True)
    job = refine_job.prepare(scene, splat, camera, settings, renderer)
    return job.targets, job.inputs, finder_of(scene, splat, renderer), copying


def finder_of(scene: bpy.types.Scene, splat: bpy.types.Object, renderer: SplatRenderer) -> Finder:
    """What finds photos in the splat of `renderer`, which has to keep its scene; the scene's solved cameras are known to it.

    Raises MemoryLimitError when the search would take more than the preferences allow.
    """
    settings = MapSettings(views=scene.gssmc.map_views, threads=preferences.threads(bpy.context, scene.gssmc.threads))
    count, coefficients = len(splat.data.points), splat_object.sh_coefficients(splat)
    needed = memory.find_bytes(count, coefficients, settings.threads, settings.views)
    memory.check("The search", needed, preferences.memory_limit(bpy.context))
    return known_of(solved_cameras(scene), Finder(renderer, MapWanted(settings, place_of(splat), up_axis.of(splat))))


def solved_cameras(scene: bpy.types.Scene) -> list[tuple[int, Camera]]:
    """Session id and solution of every camera of the scene that is trusted and still as it was solved."""
    trusted = [o for o in scene.objects if o.type == "CAMERA" and camera_solution.verdict(scene, o) == "TRUSTED"]
    records = [(camera.session_uid, camera_record.read(camera.data)) for camera in trusted]
    return [(uid, record.camera_at(scene.frame_current) or record.camera) for uid, record in records if record]


def apply_report(targets: refine_job.Targets, report: FindReport) -> str:
    """Writes the result, and moves the camera unless none was found. One sentence on what happened.

    Raises GssmcError, with nothing written, when the splat or the camera changed so that the result cannot be applied.
    """
    refined = as_refined(report) or report.refined
    if refined is not None:
        return refine_job.apply_report(targets, refined)
    _, _, camera = targets.find()
    camera_props.keep_verdict(camera.data, "failed", report.reasons, 0, report.seconds)
    values = {"name": camera.name, "reason": report.reasons[0] if report.reasons else ""}
    return rpt_('No camera was found for "{name}", which stays where it was: {reason}', **values)


HOW = {
    "": "",
    "near": n_("Found from where the camera stood."),
    "known": n_("Found from the cameras of solved photos."),
    "map": n_("Found in the map of the scan."),
}


def how_found(finder: Finder, report: FindReport) -> str:
    """From what the camera was found, as a sentence; "" when it is not trusted."""
    where: Where = finder.from_where(report)
    return rpt_(HOW[where]) if where else ""
