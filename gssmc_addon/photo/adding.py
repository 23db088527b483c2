"""Photo files made into cameras of the list, one after the other beside Blender."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import bpy

from ...core.errors import RefineError
from ...core.photos.photo import Photo, read_photo
from ...core.support.picture_names import PICTURES as SUFFIXES
from ...core.support.picture_names import RAW_SUFFIXES, spelt_parts
from ...core.support.picture_names import SUFFIXES as PICTURE_SUFFIXES
from ..jobs.machine import QueueJob
from ..jobs.worker import Steps
from ..support.texts import iface_, n_, rpt_
from . import camera as photo_camera
from . import image as photo_image
from . import list as photo_list

NAMED = 5  # files that a sentence names
FILTER = ";".join(f"*{suffix}" for suffix in SUFFIXES)  # The file browser shows these files.


def photos_in(folder: Path) -> list[Path]:
    """The photo files right in a folder, by name, without `raws_in`. Raises RefineError when there are none."""
    if not folder.is_dir():
        raise RefineError(rpt_("There is no folder at '{folder}'; choose the folder of the photos.", folder=folder))
    doubles = set(raws_in(folder))
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file() and p not in doubles)
    if not found:
        raise RefineError(rpt_("The folder '{folder}' holds no photos (JPEG, PNG, TIFF, WebP or OpenEXR).", folder=folder.name))
    return found


def raws_in(folder: Path) -> list[Path]:
    """The folder's raw photos that lie there as a picture too, which a camera writes beside them."""
    files = [path for path in folder.iterdir() if path.is_file()]
    pictures = {spelt_parts(path.name)[0] for path in files if spelt_parts(path.name)[1] in PICTURE_SUFFIXES}
    return [p for p in files if spelt_parts(p.name)[1] in RAW_SUFFIXES and spelt_parts(p.name)[0] in pictures]


def others_in(folder: Path) -> list[str]:
    """The names of a folder's other files, which `photos_in` leaves out, but for hidden ones."""
    files = (path for path in folder.iterdir() if path.suffix.lower() not in SUFFIXES and path.is_file())
    return sorted(path.name for path in files if not path.name.startswith("."))


def _decoded(read: Callable[[], Photo]) -> Steps:
    """Steps that read a photo."""
    yield "Reading"
    return read()


def chosen_photos(directory: str, names: Sequence[str], filepath: str) -> list[Path]:
    """What the file browser, or a script, chose: files of `directory` by `names`, all its photos, or the one at `filepath`."""
    if not names and not directory and filepath:
        return [Path(bpy.path.abspath(filepath))]
    folder = Path(bpy.path.abspath(directory))
    return [folder / name for name in names] if names else photos_in(folder)


class AddPhotosJob(QueueJob):
    """Reads the photos and gives each a camera. Its result is the job itself: `added` cameras and `failed` (file, why).

    `known`: how many of the files that were chosen are on the list already; `others`: names of files that are no photos;
    `raws`: how many raw photos were left out for their pictures.
    """

    status = n_("Adding photos    Esc: stop")

    def __init__(self, scene: bpy.types.Scene, paths: Sequence[Path], camera_file: str) -> None:
        super().__init__(len(paths))
        self.paths, self.camera_file = paths, camera_file
        self.added: list[int] = []  # session ids of the cameras
        self.failed: list[tuple[str, str]] = []
        self.known, self.others, self.raws = 0, list[str](), 0
        self._scene = scene.session_uid

    def check(self) -> None:
        if bpy.context.scene.session_uid != self._scene:
            raise RefineError(rpt_("Another scene was opened while photos were added; go back to the scene and add the rest."))

    def begin_item(self, index: int) -> Callable[[], Steps]:
        path = self.paths[index]
        self.step = path.name
        self.detail = iface_("Photo {number} of {count}", number=index + 1, count=self.count)
        if photo_image.is_linear(str(path)):  # OpenEXR is decoded by Blender alone, and only in the main thread.
            photo = photo_image.read_any_photo(str(path))
            return partial(_decoded, lambda: photo)
        return partial(_decoded, partial(read_photo, path))

    def end_item(self, index: int, photo: Photo) -> None:
        context, path = bpy.context, str(self.paths[index])
        given = photo_camera.find_camera(context.scene, self.camera_file, photo, may_cut=True) if self.camera_file else None
        used, given = photo_camera.cut_photo(photo, given)
        image = photo_image.load_image(path, photo) if used is photo else photo_image.load_cut(path, used)
        photo = used
        camera = photo_camera.choose_camera(context, "NEW", self.paths[index].name, photo)
        photo_camera.fit_camera(context, camera, photo_camera.LoadedPhoto(photo, image, given), set_resolution=False)
        photo_list.add(context.scene, camera, photo)
        if not image.is_dirty:
            image.buffers_free()
        self.added.append(camera.session_uid)

    def fail_item(self, index: int, message: str) -> None:
        self.failed.append((self.paths[index].name, message))

    def result(self) -> AddPhotosJob:
        return self

    def summary(self) -> str:
        """What was added, what could not be, and what was left out."""
        sentences = [rpt_("{count} photos added, each with its camera.", count=len(self.added))]
        if len(self.added) == 1:
            sentences = [rpt_("1 photo added, with its camera.")]
        if self.failed:
            sentences.append(rpt_("{count} could not be used; the list says why.", count=len(self.failed)))
        if self.known:
            sentences.append(rpt_("{count} are on the list already.", count=self.known))
        if len(self.others) == 1:
            sentences.append(rpt_("1 other file is no photo that can be read, and left out: {name}.", name=self.others[0]))
        elif self.others:
            names, more = ", ".join(self.others[:NAMED]), ", ..." if len(self.others) > NAMED else ""
            values = {"count": len(self.others), "names": names + more}
            sentences.append(rpt_("{count} other files are no photos that can be read, and left out: {names}.", **values))
        if self.raws == 1:
            sentences.append(rpt_("1 raw photo was left out, because it is there as a picture too."))
        elif self.raws:
            sentences.append(rpt_("{count} raw photos were left out, because they are there as pictures too.", count=self.raws))
        left = self.count - len(self.added) - len(self.failed)
        if left == 1:
            sentences.append(rpt_("1 was left out when you stopped."))
        elif left:
            sentences.append(rpt_("{count} were left out when you stopped.", count=left))
        return " ".join(sentences)
