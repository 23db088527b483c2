"""Many photos: their cameras refined or found, one after the other beside Blender."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

import bpy

from ...core.errors import RefineError
from ...core.locate import FindProgress, FindReport
from ...core.pose.report import RefineProgress, RefineReport
from ...core.pose.settings import RefineSettings
from ..find import job as find_job
from ..jobs.retries import RetryQueue
from ..jobs.worker import RefineInputs, Steps, refinement
from ..refine import job as refine_job
from ..splat import object as splat_object
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.session_ids import by_uid
from ..support.texts import iface_, n_, rpt_
from . import image as photo_image
from . import list as photo_list
from . import neighbours
from .entry import GssmcPhoto

COUNTED = {"trusted": n_("{count} trusted"), "check": n_("{count} check"), "failed": n_("{count} failed")}
RANK = {"": 0, "failed": 0, "check": 1, "trusted": 2}


class Scan(Enum):
    """The start of a try that needs none."""

    AGAIN = "again"


Start = neighbours.Neighbour | Scan | None  # of a try; None: the photo's own camera


@dataclass(frozen=True)
class QueueOptions:
    """`find`: in the whole scan, not from where the cameras stand; `again`: what was not found is tried again."""

    find: bool = False
    again: bool = True


class RefineQueue(RetryQueue):
    """Refines the cameras of the list one after the other against one renderer, or finds them in the whole scan if `find`;
    each is written when it is done. Photos of which no camera was found are tried again if `again`: from the cameras of solved
    ones, and in the whole scan with solved ones as views of its map.

    Its result is the job itself: `verdicts` counts them, and `failed` holds (camera, why) of those that could not begin.
    """

    status = n_("Refining the photos    Esc: stop")

    def __init__(
        self, scene: bpy.types.Scene, entries: Sequence[GssmcPhoto], settings: RefineSettings, options: QueueOptions
    ) -> None:
        copying = SplatCopying(scene.gssmc.splat)
        super().__init__(len(entries), copying)
        self.settings = settings
        if options.find:
            self.status = n_("Finding the photos    Esc: stop")
        self.failed: list[tuple[str, str]] = []
        self.found_again: list[str] = []  # Names of the cameras that were found in the second pass.
        self._verdict_of: dict[int, str] = {}
        self.options = options
        self._known_before: dict[int, int] = {}  # solved cameras that the item was found with, or without success
        self._scene, self._splat = scene.session_uid, scene.gssmc.splat.session_uid
        self._cameras = [(entry.camera.session_uid, entry.camera.name) for entry in entries]
        self._renderer = SplatRenderer(copying, settings.threads, keeps=options.find or options.again)
        self._finder = find_job.finder_of(scene, scene.gssmc.splat, self._renderer)
        self._told = find_job.Told(self._finder)
        self._targets: dict[int, refine_job.Targets] = {}  # The targets of the items that could be started.
        self._said = ""  # What the panel says of the present try, before its progress.
        self._tried = 0  # How many starts the present photo of the second pass has.

    @property
    def scene(self) -> bpy.types.Scene:
        return by_uid(bpy.data.scenes, self._scene)

    def close(self) -> None:
        self._renderer.close()

    def check(self) -> None:
        scene = by_uid(bpy.data.scenes, self._scene)
        if scene is None or by_uid(scene.objects, self._splat) is None:
            raise RefineError(
                rpt_("The splat or its scene was removed while photos were refined; those done before keep their result.")
            )

    def begin_try(self, item: int, start: Start) -> Callable[[], Steps]:
        name = self._cameras[item][1]
        number, count = self.place
        self.step, self.detail = name, iface_("Photo {number} of {count}", number=number, count=count)
        if start is Scan.AGAIN:
            self.detail = iface_("Again, {number} of {count}: in the whole scan", number=number, count=count)
        elif start:
            self.detail = iface_('Again, {number} of {count}: from "{name}"', number=number, count=count, name=start.name)
        inputs = self._inputs_of(item)
        if start is Scan.AGAIN or (start is None and self.options.find):
            self._known_before[item] = self._finder.known
            return partial(self._finder.finding, inputs, self._cameras[item][0])
        if start:
            inputs = replace(inputs, camera=replace(inputs.camera, pose=start.pose))
        return partial(refinement, inputs)

    def _inputs_of(self, item: int) -> RefineInputs:
        self._said = self.detail
        uid, name = self._cameras[item]
        scene = by_uid(bpy.data.scenes, self._scene)
        splat, camera = by_uid(scene.objects, self._splat), by_uid(scene.objects, uid)
        if camera is None:
            raise RefineError(rpt_('The camera "{name}" is no longer in the scene; nothing was changed.', name=name))
        photo = photo_image.camera_photo(camera)
        job = refine_job.prepare(scene, splat, camera, self.settings, self._renderer)
        self._targets[item] = job.targets
        if photo and photo.has_data and not photo.is_dirty and camera != scene.camera:
            photo.buffers_free()  # Blender decodes OpenEXR and would keep the pixels of every photo.
        return job.inputs

    def on_progress(self, news: RefineProgress | FindProgress) -> None:
        fraction = news.fraction
        if isinstance(news, FindProgress):
            fraction, _, told = self._told(news)
            self.detail = ". ".join(filter(None, [self._said, told]))
        self.fraction = self.progress(fraction)

    def end_try(self, item: int, start: Start, report: RefineReport | FindReport) -> bool:
        """A try of the second pass is written only when it is better than what there is."""
        before, how = self._verdict_of.get(item, ""), ""
        if isinstance(report, FindReport):
            how = find_job.how_found(self._finder, report)
        elif start:
            how = rpt_('Found from the camera of "{name}".', name=start.name)
        if start is None or RANK[report.verdict] > RANK[before]:
            camera = by_uid(bpy.data.objects, self._cameras[item][0])
            if report.verdict != "failed" and camera is not None and not photo_image.is_straight(camera.data):
                how = " ".join(filter(None, [how, rpt_(refine_job.STRAIGHTENED)]))
            if isinstance(report, FindReport):
                find_job.apply_report(self._targets[item], report)
            else:
                refine_job.apply_report(self._targets[item], report)
            self._verdict_of[item] = report.verdict
            self._write_line(item, note=how)
            if report.verdict == "trusted" and report.camera is not None:
                self._finder.know(self._cameras[item][0], report.camera)
        if start and before == "failed" != report.verdict:
            self.found_again.append(self._cameras[item][1])
        return report.verdict == "trusted" or (start is None and report.verdict == "check")

    def fail_try(self, item: int, start: Start, message: str) -> None:
        """In the second pass the photo keeps its verdict, and the line says what happened."""
        if start is None:
            self.failed.append((self._cameras[item][1], message))
        self._write_line(item, error=message)

    def other_starts(self, item: int) -> Sequence[Start]:
        if not self.options.again:
            return []
        if self.options.find:  # Nothing is new unless photos were solved since.
            return [Scan.AGAIN] if self._finder.known > self._known_before.get(item, 0) else []
        scene, camera = by_uid(bpy.data.scenes, self._scene), self._cameras[item][0]
        found = neighbours.starts(scene, by_uid(scene.objects, self._splat), camera)
        self._tried = len(found)
        return [*found, Scan.AGAIN]

    def gave_up(self, item: int) -> None:
        if self._verdict_of[item] == "failed":
            tried = rpt_("Tried again from the cameras of {count} solved photos and in the whole scan.", count=self._tried)
            if self._tried == 0 or self.options.find:
                tried = rpt_("Tried again in the whole scan, without success.")
            elif self._tried == 1:
                tried = rpt_("Tried again from the camera of 1 solved photo and in the whole scan.")
            self._write_line(item, note=tried)

    def result(self) -> RefineQueue:
        return self

    @property
    def verdicts(self) -> Counter[str]:
        """How many photos have which verdict."""
        return Counter(self._verdict_of.values())

    @property
    def refined(self) -> int:
        """How many cameras were moved."""
        return self.verdicts["trusted"] + self.verdicts["check"]

    def summary(self) -> str:
        """One to four sentences on all of them."""
        verdicts = self.verdicts
        parts = [rpt_(COUNTED[word], count=verdicts[word]) for word in COUNTED if verdicts[word]]
        if self.failed:
            parts.append(rpt_("{count} could not be refined", count=len(self.failed)))
        done = verdicts.total() + len(self.failed)
        values = {"done": done, "count": self.items, "results": ", ".join(parts) or rpt_("none done")}
        said = [rpt_("{done} of {count} photos: {results}.", **values)]
        if self.items == 1:
            said = [rpt_("{done} of 1 photo: {results}.", **values)]
        if len(self.found_again) == 1:
            said.append(rpt_("1 photo was found by trying again."))
        elif self.found_again:
            said.append(rpt_("{count} photos were found by trying again.", count=len(self.found_again)))
        return " ".join(filter(None, [*said, *[message for _, message in self.failed[:1]], self._renderer.remark]))

    def _write_line(self, item: int, error: str = "", note: str = "") -> None:
        """What the photo's line says."""
        scene, uid = by_uid(bpy.data.scenes, self._scene), self._cameras[item][0]
        entry = next((e for e in scene.gssmc.photos if e.camera and e.camera.session_uid == uid), None)
        if entry:
            entry.error, entry.note = error, note


WHICH = (
    ("ALL", "All", "Every photo of the list"),
    ("TICKED", "Ticked", "The photos that are ticked in the list"),
    ("OPEN", "Not Trusted Yet", "The photos whose camera is not trusted yet"),
)


def entries_to_refine(scene: bpy.types.Scene, which: str) -> list[GssmcPhoto]:
    """The entries with a camera: ALL, the TICKED, or those OPEN, whose camera is not trusted yet.

    Raises GssmcError when there are none.
    """
    with_camera = [entry for entry in scene.gssmc.photos if photo_list.camera_of(scene, entry)]
    if not with_camera:
        raise RefineError(rpt_("There are no photos on the list; use Add Photos first."))
    wanted = {
        "ALL": lambda entry: True,
        "TICKED": lambda entry: entry.ticked,
        "OPEN": photo_list.is_open,
    }[which]
    found = [entry for entry in with_camera if wanted(entry)]
    if not found:
        none_ticked = rpt_("No photo is ticked; tick some in the list.")
        raise RefineError(none_ticked if which == "TICKED" else rpt_("All photos are trusted already."))
    return found


def queue(scene: bpy.types.Scene, which: str, settings: RefineSettings, options: QueueOptions | None = None) -> RefineQueue:
    """The queue of the list's photos. Raises GssmcError when there is no splat or nothing to refine."""
    entries = entries_to_refine(scene, which)
    splat_object.picked(scene, scene.gssmc.splat)
    return RefineQueue(scene, entries, settings, options or QueueOptions())
