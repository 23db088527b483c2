"""The splat itself in the final picture: rendered by the engine, frame by frame, for Blenders that draw no splats.

The frames lie in a folder as multilayer OpenEXR files (`core/pictures/layers.py`), beside a list of what each was made of. A
frame that is there and was made of the same is not made again: so a render that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import CameraError, PhotoError
from ...core.geometry import conventions
from ...core.geometry.camera import Intrinsics, Pose
from ...core.geometry.conventions import BlenderLens
from ...core.pictures.layers import write_layers
from ...core.render import Renderer
from ...core.support.atomic import atomic_write
from ..camera import bridge as camera_bridge
from ..jobs.machine import QueueJob
from ..jobs.worker import Steps
from ..preview.job import content_key
from ..splat import object as splat_object
from ..splat.copy import SplatCopying
from ..splat.renderer import SplatRenderer
from ..support.texts import iface_, n_, rpt_
from .plate import frame_file

LIST_NAME = "splat_frames.json"


@dataclass(frozen=True)
class SplatView:
    """A frame to be rendered: the camera as Blender's, in the splat file's coordinates; `unit`: of the scan, in the scene's."""

    number: int
    intrinsics: Intrinsics
    pose: Pose
    unit: float

    def key(self, splat: str) -> str:
        """Tells what the frame is made of; `splat` tells the splat."""
        k = self.intrinsics
        numbers = np.concatenate([self.pose.R.ravel(), self.pose.t, [k.width, k.height, k.fx, k.fy, k.cx, k.cy, self.unit]])
        return hashlib.sha256(numbers.tobytes() + splat.encode()).hexdigest()


class SplatFramesJob(QueueJob):
    """Renders the frames that are missing. Its result is the job itself: `failed` holds the reason by frame."""

    status = n_("Rendering the splat    Esc: stop")

    def __init__(self, views: list[SplatView], splat: bpy.types.Object, folder: Path) -> None:
        content = content_key(splat)
        self.folder, self.views = folder, views
        self.keys = {view.number: view.key(content) for view in views}
        self.listed = read_list(folder)
        self.todo = [view for view in views if not self._is_there(view)]
        self.failed: dict[int, str] = {}
        copying = SplatCopying(splat)
        super().__init__(len(self.todo), copying)
        self._renderer = SplatRenderer(copying, single=True)

    def close(self) -> None:
        self._renderer.close()

    def begin_item(self, index: int) -> Callable[[], Steps]:
        view = self.todo[index]
        self.step = iface_("Frame {frame}", frame=view.number)
        self.detail = iface_("{number} of {count}", number=index + 1, count=len(self.todo))
        return partial(_drawn, self._renderer, view, frame_file(self.folder, view.number), lambda: self.cancelled)

    def end_item(self, index: int, result: int) -> None:
        self.listed[str(result)] = self._entry(result)
        with atomic_write(self.folder / LIST_NAME) as file:
            json.dump(self.listed, file, indent=1)

    def fail_item(self, index: int, message: str) -> None:
        self.failed[self.todo[index].number] = message

    def result(self) -> SplatFramesJob:
        return self

    def _is_there(self, view: SplatView) -> bool:
        try:
            return self.listed.get(str(view.number)) == self._entry(view.number)
        except OSError:
            return False

    def _entry(self, number: int) -> str:
        """What a frame is made of, and how long its file is: one that was cut off is made again. Raises OSError."""
        return f"{self.keys[number]} {frame_file(self.folder, number).stat().st_size}"


def views_of(scene: bpy.types.Scene, start: int, end: int) -> list[SplatView]:
    """The camera of each frame from `start` to `end`; of the present frame alone where it is the same in all.

    The scene ends at the frame where it was. Raises CameraError when camera or splat cannot be rendered.
    """
    camera, splat = scene.camera, scene.gssmc.splat
    if camera is None or camera.type != "CAMERA":
        raise CameraError(rpt_("The scene has no camera; add one."))
    current, part = scene.frame_current, scene.frame_subframe
    try:
        views = []
        for number in range(start, end + 1):
            scene.frame_set(number)
            views.append(_view(scene, camera, splat, number))
    finally:
        scene.frame_set(current, subframe=part)
    if len({view.key("") for view in views}) == 1 and start <= current <= end:
        return [view for view in views if view.number == current]
    return views


def folder_of(path: str) -> Path:
    """The folder that an artist named. Raises PhotoError where none is, or it lies beside a .blend that has no place yet."""
    if not path.strip():
        raise PhotoError(rpt_("No folder is given for the frames; choose one."))
    if path.startswith("//") and not bpy.data.filepath:
        raise PhotoError(rpt_("The folder lies beside the .blend, which is not saved yet; save it, or choose another folder."))
    return Path(bpy.path.abspath(path))


def read_list(folder: Path) -> dict[str, str]:
    """What the frames in a folder were made of; empty where that cannot be read."""
    try:
        found = json.loads((folder / LIST_NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _view(scene: bpy.types.Scene, camera: bpy.types.Object, splat: bpy.types.Object, number: int) -> SplatView:
    copy, data, render = camera_bridge.read_camera(scene, camera, splat), camera.data, scene.render
    size = [max(1, side * render.resolution_percentage // 100) for side in (render.resolution_x, render.resolution_y)]
    lens = BlenderLens(data.lens, data.sensor_width, data.sensor_height, data.sensor_fit, data.shift_x, data.shift_y)
    lens = camera_bridge.with_aspects(lens, camera_bridge.render_aspects(scene))
    unit = camera_bridge.splat_similarity(splat).scale
    return SplatView(number, conventions.intrinsics_from_blender(lens, size[0], size[1]), copy.pose, unit)


def _drawn(renderer: SplatRenderer, view: SplatView, path: Path, stopped: Callable[[], bool]) -> Steps:
    """Renders and writes one frame; its result is the frame's number."""
    yield None
    own = renderer.get()
    if isinstance(own, Renderer):
        picture = own.render(view.intrinsics, view.pose, stopped)
    else:
        picture = own.render(view.intrinsics, view.pose)
    try:
        write_layers(path, picture, view.unit)
    except OSError as error:
        raise PhotoError(n_("The frame {path} cannot be written ({why}).").format(path=path, why=error.strerror)) from error
    return view.number


def keep(scene: bpy.types.Scene, job: SplatFramesJob, folder: str) -> str:
    """Notes on the scene which frames there are. A sentence on them."""
    kept, numbers = scene.gssmc.composite, [view.number for view in job.views]
    first = job.views[0].intrinsics
    kept.frames_folder, kept.frames_range = folder, (min(numbers), max(numbers))
    kept.frames_size = first.width, first.height
    there = len(job.views) - len(job.todo)
    if len(job.views) == 1:
        return rpt_("1 frame of the splat is rendered.")
    return rpt_("{count} frames of the splat are rendered, {there} of them before.", count=len(job.views), there=there)


def check_idle(scene: bpy.types.Scene) -> None:
    """Raises CameraError while a composite is set up, whose camera shows more than its own frame."""
    splat_object.picked(scene, scene.gssmc.splat)
    if scene.gssmc.composite.is_set_up:
        raise CameraError(rpt_("A composite is set up in this scene; use Remove Composite first, and render the splat then."))
