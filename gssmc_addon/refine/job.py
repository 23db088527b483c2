"""A refinement of one camera, from Blender's data and back: prepared, watched, applied.

Blender's data may change under a running job (undo, deletion, another file), so a job keeps session ids, never references.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import bpy

from ...core.errors import RefineError
from ...core.features.frontend import check_choice
from ...core.pose.report import RefineProgress, RefineReport
from ...core.pose.settings import RefineSettings
from ...core.render import memory
from ..camera import bridge as camera_bridge
from ..camera import channels as camera_channels
from ..camera import solution as camera_solution
from ..jobs.machine import Job
from ..jobs.worker import RefineInputs, Steps, refinement
from ..photo import camera as photo_camera
from ..photo import image as photo_image
from ..photo import mask as mask_source
from ..pins import state as pin_state
from ..plate import source as plate_source
from ..registration import camera_props, preferences
from ..splat import object as splat_object
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support import problem
from ..support.session_ids import by_uid
from ..support.texts import iface_, n_, rpt_

STRAIGHTENED = n_("The background image had an offset, scale, rotation, flip or crop of its own, which was reset.")
REMOVED = {
    "splat": n_('The splat "{name}" was removed while the refinement ran; nothing was changed.'),
    "camera": n_('The camera "{name}" was removed while the refinement ran; nothing was changed.'),
    "photo": n_('The photo "{name}" was removed while the refinement ran; nothing was changed.'),
}


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
        """The targets by their session ids and present names."""
        names = (splat.name, camera.name, photo.name)
        return cls(scene.session_uid, splat.session_uid, camera.session_uid, photo.session_uid, names)

    def find(self) -> tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Object]:
        """The live scene, splat and camera. Raises RefineError when something is gone."""
        scene = by_uid(bpy.data.scenes, self.scene)
        if scene is None:
            raise RefineError(rpt_("The scene was removed while the refinement ran; nothing was changed."))
        splat, camera = by_uid(scene.objects, self.splat), by_uid(scene.objects, self.camera)
        live = (splat, camera, by_uid(bpy.data.images, self.photo))
        for what, name, item in zip(REMOVED, self.names, live, strict=True):
            if item is None:
                raise RefineError(rpt_(REMOVED[what], name=name))
        return scene, splat, camera


class RefineJob(Job):
    """One refinement of one camera; its result is the RefineReport."""

    status = n_("Refining the camera    Esc: cancel")

    def __init__(
        self,
        targets: Targets,
        inputs: RefineInputs,
        copying: SplatCopying | None = None,
        work: Callable[[], Steps] | None = None,
    ) -> None:
        """`work`: what is done in place of the refinement alone."""
        super().__init__(work or partial(refinement, inputs), copying)
        self.targets = targets
        self.inputs = inputs

    def check(self) -> None:
        self.targets.find()

    def close(self) -> None:
        self.inputs.splat.close()

    def on_progress(self, news: RefineProgress) -> None:
        self.fraction, self.step = news.fraction, news.step[:1].upper() + news.step[1:]
        self.detail = iface_("Iteration {number} of {count}", number=max(news.iteration, 1), count=news.iterations)
        self.detail = ". ".join(filter(None, [self.detail, self.inputs.splat.remark.rstrip(".")]))


def prepare(
    scene: bpy.types.Scene,
    splat: bpy.types.Object | None,
    camera: bpy.types.Object | None,
    settings: RefineSettings,
    renderer: SplatRenderer | None = None,
) -> RefineJob:
    """A refinement of the camera by its photo. Copies all inputs out of Blender, but for the splat, which the job does first,
    unless its `renderer` is there already.

    Raises GssmcError, with what to do, when something is missing or unfit.
    """
    splat = splat_object.picked(scene, splat)
    camera, photo = _with_photo(camera)
    check_choice(settings)
    camera_channels.check_writable(camera)
    copy = camera_bridge.read_camera(scene, camera, splat)
    source = mask_source.masked(plate_source.source_at(scene, camera, photo), mask_source.of(camera))
    _check_memory(splat, photo, settings)
    copying = None
    if renderer is None:
        copying = SplatCopying(splat)
        renderer = SplatRenderer(copying, settings.threads)
    inputs = RefineInputs(renderer, source, copy, settings, pin_state.held(scene, camera.data))
    return RefineJob(Targets.of(scene, splat, camera, photo), inputs, copying)


def _photo_of(camera: bpy.types.Object | None) -> bpy.types.Image | None:
    return photo_image.camera_photo(camera) if camera and camera.type == "CAMERA" else None


def _with_photo(camera: bpy.types.Object | None) -> tuple[bpy.types.Object, bpy.types.Image]:
    """The camera with its photo. Raises RefineError when one of them is missing."""
    photo = _photo_of(camera)
    if camera is None or camera.type != "CAMERA":
        raise RefineError(rpt_("The scene has no camera for the photo; use Add Photo in the GS-SMC panel."))
    if photo is None:
        raise RefineError(rpt_('The camera "{name}" has no photo; use Add Photo in the GS-SMC panel.', name=camera.name))
    return camera, photo


def missing(scene: bpy.types.Scene) -> str:
    """Why no photo of the scene can be refined or looked at, for a poll; "" when one can. Scripts may name any camera."""
    try:
        splat_object.picked(scene, scene.gssmc.splat)
        camera, photo = scene.camera, _photo_of(scene.camera)
        if photo is None and not any(photo_image.camera_photo(o) for o in scene.objects if o.type == "CAMERA"):
            _with_photo(camera)
    except RefineError as error:
        return str(error)
    return ""


def _check_memory(splat: bpy.types.Object, photo: bpy.types.Image, settings: RefineSettings) -> None:
    """Raises MemoryLimitError when the refinement would take more than the preferences allow."""
    coefficients = splat_object.sh_coefficients(splat)
    needed = memory.refine_bytes(len(splat.data.points), coefficients, photo.size[0] * photo.size[1], settings.threads)
    memory.check("The refinement", needed, preferences.memory_limit(bpy.context))


def apply_report(targets: Targets, report: RefineReport, remark: str = "") -> str:
    """Writes the result, and moves the camera unless the verdict is "failed". One sentence on what happened, and the
    `remark` on how it was done, if there is one.

    Raises GssmcError, with nothing written, when the splat or the camera changed so that the result cannot be applied.
    """
    scene, splat, camera = targets.find()
    problem.remember(report)
    notes = [remark] if remark else []
    if report.verdict != "failed":
        camera_channels.check_writable(camera)
        camera_bridge.write_camera(scene, camera, splat, report.camera)
        if keyed := camera_channels.write_keyframes(scene, camera):
            notes.append(keyed)
        if not photo_image.is_straight(camera.data):
            notes.append(rpt_(STRAIGHTENED))
        state = camera.data.gssmc.lens_state
        camera_solution.keep(scene, camera, splat, camera_solution.of_report(report, state))
        if camera == scene.camera:
            photo_camera.stop_moving_with_view()
    elif camera_solution.verdict(scene, camera) == "PINNED":  # It stands where its pins place it, as before.
        camera_props.keep_verdict(
            camera.data, pin_state.PINNED, (*camera.data.gssmc.reasons.splitlines(), report.reasons[0]), 0, report.seconds
        )
    else:
        camera_props.keep_verdict(camera.data, report.verdict, report.reasons, len(report.iterations), report.seconds)
    values: dict[str, object] = {"name": camera.name, "reason": report.reasons[0] if report.reasons else ""}
    if report.verdict == "failed":
        said = rpt_('No camera was found for "{name}", which stays where it was: {reason}', **values)
        return " ".join([said, *notes])
    values |= {"verdict": iface_(camera_props.VERDICT_NAMES[report.verdict.upper()]).lower(), "seconds": report.seconds}
    return " ".join([rpt_('"{name}" was refined ({verdict}) in {seconds:.1f} s: {reason}', **values), *notes])
