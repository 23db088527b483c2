"""Cameras in from files of other programs, and out to them; all in the coordinates of the splat file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ..core import datasets
from ..core.atomic import atomic_write
from ..core.camera import Camera
from ..core.camera_files import Start, camera_to_dict
from ..core.datasets import colmap, nerfstudio
from ..core.errors import CameraError, DatasetError, GssmcError
from ..core.lens_guess import guess_lens
from ..core.photo import Photo, check_size, photo_facts, read_photo
from ..core.photo_size import EXR_SIGNATURE
from . import camera_bridge, photo_camera, photo_image

PHOTO_PLACES = (".", "images", "../images", "../../images")  # seen from the file: COLMAP's and nerfstudio's habits
NO_SPLAT = "Cameras need a splat to stand in; import the splat first."


@dataclass(frozen=True)
class Incoming:
    """A camera to be made: the engine's, and its photo where one was found (`file`, and what its header says)."""

    camera: Camera
    file: Path | None
    photo: Photo | None


def gather(path: Path, photos: Path | None) -> tuple[list[Incoming], int]:
    """The cameras of a file or folder, and how many were left out for want of a lens. Raises GssmcError."""
    path = path.parent if path.name in (colmap.CAMERAS, colmap.POINTS) else path
    folder = path if path.is_dir() else path.parent
    places = [photos] if photos else [folder / place for place in PHOTO_PLACES]
    found = [_incoming(start, places) for start in datasets.starts(path)]
    usable = [item for item in found if item is not None]
    if not usable:
        raise CameraError(f"No camera in '{path.name}' has a lens, nor a photo to take one from; give the photos' folder.")
    return usable, len(found) - len(usable)


def _incoming(start: Start, places: Sequence[Path]) -> Incoming | None:
    name = start.file.replace("\\", "/")
    tries = [place / n for place in places for n in (name, Path(name).name)] if name else []
    file = next((f for f in tries if f.is_file()), None)
    photo = _header(file) if file else None
    if photo is None:
        return Incoming(start.camera(start.intrinsics), None, None) if start.intrinsics else None
    camera = start.camera(guess_lens(photo).intrinsics)
    return Incoming(replace(camera, intrinsics=check_size(photo, camera.intrinsics)), file, photo)


def _header(file: Path) -> Photo | None:
    """A photo of which only size and focal length are known, for decoding hundreds takes minutes; None for a bad one."""
    try:
        width, height, focal = photo_facts(file)
    except (GssmcError, OSError):
        return None
    return Photo(np.zeros((1, 1, 3), np.uint8), str(file), focal, full_size=(width, height))


def add_cameras(context: bpy.types.Context, source: str, found: Sequence[Incoming], set_resolution: bool) -> None:
    """A collection of camera objects; the first one becomes the scene's camera."""
    scene = context.scene
    collection = bpy.data.collections.new(source)
    scene.collection.children.link(collection)
    for number, item in enumerate(found):
        name = Path(item.camera.file).stem or source
        obj = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        collection.objects.link(obj)
        k = item.camera.intrinsics
        if number == 0:
            scene.camera = obj
            photo_camera.frame(scene, k.width, k.height, set_resolution)
        if item.file:
            obj.data.gssmc.photo = _image(item.file)
        camera_bridge.write_camera(scene, obj, scene.gssmc.splat, item.camera)


def _image(file: Path) -> bpy.types.Image:
    """The photo upright: Blender's own image unless EXIF turns it."""
    width, height, _ = photo_facts(file)
    image = bpy.data.images.load(str(file), check_existing=True)
    if tuple(image.size) == (width, height) or file.read_bytes()[:4] == EXR_SIGNATURE:
        return image
    return photo_image.load_image(str(file), read_photo(file))


def collect(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object]) -> list[tuple[bpy.types.Object, Camera]]:
    """The engine's camera of each object, at its photo's size, else the render's. Raises GssmcError, naming the camera."""
    splat = scene.gssmc.splat
    if splat is None:
        raise CameraError(NO_SPLAT)
    if not objects:
        raise CameraError("There is no camera to export; select one, or add a photo first.")
    found = []
    for obj in objects:
        image = photo_image.camera_photo(obj)
        size = tuple(image.size) if image else camera_bridge.lens_frame(scene, obj.data)
        name = Path(bpy.path.abspath(image.filepath or image.name)).name if image else f"{obj.name}.png"
        found.append((obj, replace(camera_bridge.read_camera(scene, obj, splat).at_size(*size), file=name)))
    names = [camera.file for _, camera in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise DatasetError(f'Two cameras have the photo "{twice}", by whose name files tell cameras apart; export one of them.')
    return found


def write(path: Path, kind: str, found: Sequence[tuple[bpy.types.Object, Camera]]) -> None:
    """Writes the cameras: COLMAP into the folder `path`, NERFSTUDIO and JSON as the file `path`. Raises GssmcError."""
    cameras = [camera for _, camera in found]
    try:
        if kind == "COLMAP":
            path.mkdir(parents=True, exist_ok=True)
            colmap.write_model(path, cameras)
        elif kind == "NERFSTUDIO":
            nerfstudio.write_transforms(path, cameras)
        else:
            with atomic_write(path) as file:
                json.dump({"frames": [_record(obj, camera) for obj, camera in found]}, file, indent=1)
    except OSError as error:
        raise DatasetError(f"'{path}' cannot be written ({error.strerror}); choose another place.") from error


def _record(obj: bpy.types.Object, camera: Camera) -> dict[str, object]:
    note = obj.data.gssmc
    said = {} if note.verdict == "NONE" else {"verdict": note.verdict.lower(), "reasons": note.reasons.splitlines()}
    return {**camera_to_dict(camera), **said}
