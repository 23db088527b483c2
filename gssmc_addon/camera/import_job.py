"""Imports cameras from files of other programs. They are read in a thread, with their photos' headers, and made in slices.

Thousands of them must not hold up the window. Between two slices Blender's data may change (undo, another file), so what was
made is kept by session id.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core import cameras as datasets
from ...core.cameras.files import StartCamera
from ...core.cameras.training_world import Axes, ScanAxes, read_training_world
from ...core.errors import CameraError, GssmcError, PhotoError
from ...core.geometry import conventions
from ...core.geometry.camera import Camera
from ...core.geometry.pinhole_cut import WideCamera
from ...core.photos.fit import fit_camera, fit_wide_camera
from ...core.photos.lens_guess import guess_lens
from ...core.photos.photo import Photo, PhotoFacts, photo_facts, read_photo
from ...core.photos.places import PhotoFinder
from ...core.support.picture_names import stem_of
from ..jobs.machine import Job
from ..photo import camera as photo_camera
from ..photo import image as photo_image
from ..splat import object as splat_object
from ..support.session_ids import by_uid
from ..support.texts import iface_, n_, rpt_
from . import alembic
from . import bridge as camera_bridge

log = logging.getLogger(__name__)

COLMAP_OTHERS = ("cameras", "points3D", "frames", "rigs")
SLICE_S = 0.05  # How much of each tick is used; a photo that has to be rotated may take longer.
READING = 0.5  # share of the progress shown


@dataclass(frozen=True)
class Incoming:
    """A camera to be made: the engine's, and its photo where one was found (`file`; `turned`: not stored upright).

    `is_cut`: the camera is that of the pinhole cut of a wide lens, whose photo is not cut here: hundreds would take minutes.
    """

    camera: Camera
    file: Path | None
    turned: bool = False
    is_cut: bool = False


@dataclass(frozen=True)
class LeftOut:
    """A camera that cannot be made: `why` in a sentence, "" where neither the file nor the photo gives a lens."""

    why: str = ""


@dataclass(frozen=True)
class Found:
    """What was read of a file: its cameras in their order, and sentences on what of it is left out."""

    cameras: list[Incoming | LeftOut]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Worlds:
    """In which world cameras come. `world`: nerfstudio's file that says how the splat's lies to the cameras'; `axes`: in which
    of the two worlds of the splat, `scan`, they are then.
    """

    world: Path | None = None
    axes: Axes = "auto"
    scan: ScanAxes | None = None


def read_incoming(
    path: Path, photos: Path | None, worlds: Worlds = Worlds(), given: datasets.CameraFile | None = None
) -> Generator[float, None, Found]:
    """The cameras of a file or folder, read step by step (yields the share done). Needs no Blender. Raises GssmcError.

    `given`: the cameras, where Blender has read them.
    """
    path = model_of(path)
    finder, read, found = PhotoFinder(path, photos), given or datasets.starts(path), []
    starts = read.placed
    notes = read.notes
    if worlds.world is not None:
        moved = read_training_world(worlds.world)
        starts = tuple(replace(start, pose=moved.pose_to_scene(start.pose)) for start in starts)
    if worlds.scan is not None:
        settled, sentence = worlds.scan.settled(starts, worlds.axes)
        starts, notes = tuple(settled), (*notes, *filter(None, [sentence]))
    for number, start in enumerate(starts, start=1):
        found.append(_incoming(start, finder))
        yield number / len(starts)
    return Found(found, (*notes, *_uncut(found)))


def _uncut(found: Sequence[Incoming | LeftOut]) -> list[str]:
    """What is said of cameras whose photos would have to be cut."""
    count = sum(isinstance(one, Incoming) and one.is_cut for one in found)
    if count == 1:
        return [rpt_("1 camera of a wide lens shows the middle of its view, without the photo; Add Photo cuts that.")]
    if not count:
        return []
    return [
        rpt_(
            "{count} cameras of wide lenses show the middle of their view, without their photos; Add Photo cuts those.",
            count=count,
        )
    ]


def model_of(path: Path) -> Path:
    """The folder of a COLMAP model of which another file than that of the images was chosen, any other path as it is."""
    return path.parent if path.stem in COLMAP_OTHERS and path.suffix in (".txt", ".bin") else path


def _incoming(start: StartCamera, finder: PhotoFinder) -> Incoming | LeftOut:
    file = finder.find(start.file)
    facts = _facts(file) if file else None
    if file is None or facts is None:
        return Incoming(start.camera(start.intrinsics), None) if start.intrinsics else LeftOut()
    # Only size and focal length are read here, because decoding hundreds of photos would take minutes.
    size = facts.width, facts.height
    photo = Photo(np.zeros((1, 1, 3), np.uint8), str(file), facts.focal_35mm, full_size=size, orientation=facts.orientation)
    try:
        given = start.camera(guess_lens(photo).intrinsics, facts.orientation)
        if isinstance(given, WideCamera) and not given.lens.is_panorama:
            wide = fit_wide_camera(photo, given)
            return Incoming(Camera(wide.intrinsics, wide.pose, wide.file), None, is_cut=True)
        camera = fit_camera(photo, given)
    except (CameraError, PhotoError) as error:
        return LeftOut(str(error))
    return Incoming(camera, file, not facts.stored_upright)


def _facts(file: Path) -> PhotoFacts | None:
    """What the photo's header says; None when the photo cannot be read."""
    try:
        return photo_facts(file)
    except (GssmcError, OSError):
        return None


class CameraImport(Job):
    """The import of `path`. Its result is the job itself: `made` cameras, `shown` with their photo, `left_out` for no lens, and
    why others do not fit their photos (`unfit`).

    The cameras come into the scene at the end, all together, in a collection named after the file.
    """

    status = n_("Importing cameras    Esc: cancel")
    at_mouse = True

    def __init__(
        self, scene: bpy.types.Scene, path: Path, photos: Path | None, set_resolution: bool, worlds: Worlds = Worlds()
    ) -> None:
        given = alembic.read(path) if alembic.is_alembic(path) else None
        super().__init__(partial(read_incoming, path, photos, worlds, given))
        self.step = n_("Reading cameras and photos")
        self.made = self.shown = self.left_out = 0
        self.unfit: list[str] = []
        self.notes: tuple[str, ...] = ()
        self._path, self._set_resolution = path, set_resolution
        self._scene, self._splat = scene.session_uid, scene.gssmc.splat.session_uid
        self._left: list[Incoming] | None = None  # The cameras that are still to be made, in reverse order.
        self._collection = 0
        self._first = 0
        self._size: tuple[int, int] | None = None  # The render resolution before the import changed it.

    def check(self) -> None:
        scene = by_uid(bpy.data.scenes, self._scene)
        if scene is None or by_uid(scene.objects, self._splat) is None:
            raise CameraError(rpt_("The splat or its scene was removed while cameras were imported; import them again."))

    def on_progress(self, news: float) -> None:
        self.fraction = READING * news

    def advance(self) -> CameraImport | None:
        if self._left is None:
            found = super().advance()
            if found is not None:
                self._begin(found)
            return None
        until = time.perf_counter() + SLICE_S
        while self._left:
            self._make(self._left[-1])
            self._left.pop()
            if self._left and time.perf_counter() > until:
                self.fraction = READING + (1 - READING) * self.made / (self.made + len(self._left))
                self.show()
                return None
        return self

    def finish(self) -> None:
        """Brings what was made into the scene; the first camera becomes the scene's. Raises CameraError when it is gone."""
        self.check()
        scene, collection = by_uid(bpy.data.scenes, self._scene), self._living_collection()
        scene.collection.children.link(collection)
        scene.camera = by_uid(collection.objects, self._first)
        self._collection, self._size = 0, None  # From here on a cancelled job no longer removes them.

    def cancel(self) -> None:
        """Also takes back what was made and set so far, unless `finish()` has brought it into the scene."""
        super().cancel()
        scene, collection = (
            by_uid(bpy.data.scenes, self._scene),
            by_uid(bpy.data.collections, self._collection),
        )
        if scene and self._size:
            scene.render.resolution_x, scene.render.resolution_y = self._size
        self._size = None
        if collection is None:
            return
        data = [obj.data for obj in collection.objects]
        images = {obj.data.gssmc.photo for obj in collection.objects}
        bpy.data.batch_remove([*collection.objects, *data, collection])
        bpy.data.batch_remove([image for image in images if image and image.users == 0])

    def _begin(self, found: Found) -> None:
        usable = [item for item in found.cameras if isinstance(item, Incoming)]
        self.unfit = [item.why for item in found.cameras if isinstance(item, LeftOut) and item.why]
        self.notes = found.notes
        if not usable and self.unfit:
            raise CameraError(self.unfit[0])
        if not usable:
            name = model_of(self._path).name
            raise CameraError(
                rpt_("No camera in '{file}' has a lens, nor a photo to take one from; give the photos' folder.", file=name)
            )
        self.left_out = len(found.cameras) - len(usable) - len(self.unfit)
        self.step = iface_("Making cameras")
        scene, lens = by_uid(bpy.data.scenes, self._scene), usable[0].camera.intrinsics
        self._size = scene.render.resolution_x, scene.render.resolution_y
        pixel = conventions.pixel_shape(lens)
        photo_camera.frame(scene, (lens.width, lens.height), self._set_resolution, pixel)
        self._collection = bpy.data.collections.new(self._path.stem or self._path.name).session_uid
        self._left = usable[::-1]

    def _make(self, item: Incoming) -> None:
        scene, collection = by_uid(bpy.data.scenes, self._scene), self._living_collection()
        name = stem_of(item.camera.file) or self._path.stem
        obj = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        collection.objects.link(obj)
        if item.file:
            obj.data.gssmc.photo = _image(item.file, item.turned)
            self.shown += 1
        splat = by_uid(scene.objects, self._splat)
        camera_bridge.write_new_camera(scene, obj, splat, item.camera.relative_to(splat_object.origin_of(splat)))
        obj.data.gssmc.lens_state = "GUESSED" if item.camera.focal_guessed else "CALIBRATED"
        self._first = self._first or obj.session_uid
        self.made += 1

    def _living_collection(self) -> bpy.types.Collection:
        collection = by_uid(bpy.data.collections, self._collection)
        if collection is None:
            raise CameraError(rpt_("The cameras were removed while they were imported; import them again."))
        return collection


def _image(file: Path, turned: bool) -> bpy.types.Image:
    """The photo upright: Blender's own image, which it decodes when it first shows it, unless EXIF turns the photo or Blender
    cannot read its kind.
    """
    if turned or file.suffix.lower() not in photo_image.READ_BY_BLENDER:
        try:
            return photo_image.load_image(str(file), read_photo(file))
        except PhotoError as error:
            # The header could be read and the pixels cannot, which must not cost the other cameras.
            log.warning("%s", error)
    return bpy.data.images.load(str(file), check_existing=True)
