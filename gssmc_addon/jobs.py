"""A refinement of one camera, from Blender's data and back: gather, watch, apply.

Blender's data may change under a running job (undo, deletion, another file), so a job keeps session ids, never references.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy

from ..core.errors import GssmcError, RefineError
from ..core.features.frontend import check_choice
from ..core.pose.report import RefineProgress, RefineReport
from ..core.pose.settings import RefineSettings
from . import camera_bridge, camera_channels, photo_image, properties, splat_object
from .worker import Failure, RefineInputs, Worker

TICK_S = 0.1
SHUTDOWN_JOIN_S = 5.0


@dataclass(frozen=True)
class Targets:
    """What a job works on, by session id, with the names for messages."""

    scene: int
    splat: int
    camera: int
    photo: int
    names: tuple[str, str, str]  # splat, camera, photo

    @classmethod
    def of(cls, scene: bpy.types.Scene, splat: bpy.types.Object, camera: bpy.types.Object, photo: bpy.types.Image) -> Targets:
        names = (splat.name, camera.name, photo.name)
        return cls(scene.session_uid, splat.session_uid, camera.session_uid, photo.session_uid, names)

    def find(self) -> tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]:
        """The live scene, splat and camera. Raises RefineError when something is gone."""
        scene = _by_uid(bpy.data.scenes, self.scene)
        if scene is None:
            raise RefineError("The scene was removed while the refinement ran; nothing was changed.")
        splat, camera = _by_uid(scene.objects, self.splat), _by_uid(scene.objects, self.camera)
        found = (splat, camera, _by_uid(bpy.data.images, self.photo))
        for what, name, item in zip(("splat", "camera", "photo"), self.names, found, strict=True):
            if item is None:
                raise RefineError(f'The {what} "{name}" was removed while the refinement ran; nothing was changed.')
        return scene, splat, camera


def _by_uid(blocks: Iterable[Any], uid: int) -> Any:
    return next((block for block in blocks if block.session_uid == uid), None)


class RefineJob:
    """One refinement: `start()` it for a thread, then `tick()` from the main thread until it says it is over."""

    def __init__(self, targets: Targets, inputs: RefineInputs) -> None:
        self.targets = targets
        self.inputs = inputs
        self.progress = RefineProgress(0, inputs.settings.iterations, "Starting", 0.0)
        self.cancelled = False
        self._worker = Worker(inputs)

    def start(self) -> None:
        self._worker.start()

    def run(self) -> RefineReport:
        """Start to end, for callers that may block. Raises GssmcError as `tick` does."""
        self.start()
        try:
            while True:
                report = self.tick()
                if report:
                    return report
                self.join(TICK_S)
        finally:
            self.cancel()

    def cancel(self) -> None:
        """Stops the job without waiting; its thread ends by itself at its next step."""
        self.cancelled = True
        self._worker.stop()

    def join(self, timeout_s: float) -> bool:
        return self._worker.join(timeout_s)

    def tick(self) -> RefineReport | None:
        """The report once there is one. Raises GssmcError when the job cannot go on; its thread is told to stop then."""
        try:
            self.targets.find()
            for news in self._worker.news():
                if isinstance(news, Failure):
                    raise RefineError(news.message)
                if isinstance(news, RefineReport):
                    return news
                self.progress = news
                redraw()
        except GssmcError:
            self.cancel()
            raise
        return None


def gather(
    scene: bpy.types.Scene,
    splat: bpy.types.Object | None,
    camera: bpy.types.Object | None,
    photo: bpy.types.Image | None,
    settings: RefineSettings,
) -> RefineJob:
    """Copies all inputs out of Blender. Raises GssmcError, with what to do, when something is missing or unfit."""
    if splat is None:
        raise RefineError("No splat is picked; import one with File > Import > Gaussian Splats, or pick it in the panel.")
    if splat.name not in scene.objects:
        raise RefineError(f'The splat "{splat.name}" is no longer in the scene; pick another one in the panel.')
    if camera is None or camera.type != "CAMERA":
        raise RefineError("The scene has no camera for the photo; use Add Photo in the GS-SMC panel.")
    if photo is None:
        raise RefineError(f'The camera "{camera.name}" has no photo; use Add Photo in the GS-SMC panel.')
    check_choice(settings)
    camera_channels.check_writable(camera)
    copy = camera_bridge.read_camera(scene, camera, splat)
    source = photo_image.photo_source(photo)
    inputs = RefineInputs(splat_object.copy_splat(splat), source, copy, settings)
    return RefineJob(Targets.of(scene, splat, camera, photo), inputs)


def apply_report(targets: Targets, report: RefineReport) -> str:
    """Writes the result, and moves the camera unless the verdict is "failed". One sentence on what happened.

    Raises GssmcError, with nothing written, when the splat or the camera changed so that the result cannot be applied.
    """
    scene, splat, camera = targets.find()
    notes = []
    if report.verdict != "failed":
        camera_channels.check_writable(camera)
        if camera_bridge.write_camera(scene, camera, splat, report.camera):
            notes.append("The render's pixel aspect was set to the camera's.")
        if keyed := camera_channels.write_keyframes(scene, camera):
            notes.append(keyed)
    properties.note_verdict(camera.data, report.verdict, report.reasons, len(report.iterations), report.seconds)
    first = report.reasons[0] if report.reasons else ""
    if report.verdict == "failed":
        return f'No camera was found for "{camera.name}", which stays where it was: {first}'
    return " ".join([f'"{camera.name}" was refined ({report.verdict}) in {report.seconds:.1f} s: {first}', *notes])


class _Slot:
    """The one job of this Blender, and the timer that drives it."""

    def __init__(self) -> None:
        self.job: RefineJob | None = None
        self.timer: bpy.types.Timer | None = None


_slot = _Slot()  # a modal operator and a panel have no other common place that is not saved into the .blend


def active() -> RefineJob | None:
    """The running job, for the panel and Cancel."""
    return _slot.job


def begin(context: bpy.types.Context, job: RefineJob) -> None:
    """Makes `job` the running one and starts its thread and its timer."""
    _slot.job = job
    _slot.timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
    context.workspace.status_text_set("Refining the camera    Esc: cancel")
    job.start()


def end(job: RefineJob) -> None:
    """Forgets `job` and stops its timer; harmless when that was done already."""
    if _slot.job is not job:
        return
    if _slot.timer is not None:
        bpy.context.window_manager.event_timer_remove(_slot.timer)
    _slot.job = _slot.timer = None
    for workspace in bpy.data.workspaces:
        workspace.status_text_set(None)
    redraw()


def redraw() -> None:
    """Asks every 3D viewport's sidebar to draw again; not the viewport itself, which may take long with a large splat."""
    areas = (area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == "VIEW_3D")
    for region in (region for area in areas for region in area.regions if region.type == "UI"):
        region.tag_redraw()


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    if _slot.job:
        _slot.job.cancel()
        end(_slot.job)


def register() -> None:
    bpy.app.handlers.load_pre.append(_before_load)


def unregister() -> None:
    """Cancels a running job first, so that nothing of it outlives the extension."""
    job = _slot.job
    if job:
        job.cancel()
        end(job)
        job.join(SHUTDOWN_JOIN_S)
    bpy.app.handlers.load_pre.remove(_before_load)
