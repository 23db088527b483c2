"""Cameras out to files of other programs, in the coordinates of the splat file. camera_import_job is the way in."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ...core.cameras import colmap, nerfstudio
from ...core.cameras.files import camera_to_dict
from ...core.cameras.training_world import read_training_world
from ...core.errors import CameraError, DatasetError
from ...core.geometry.camera import Camera
from ...core.support.atomic import atomic_write
from ..photo import image as photo_image
from ..support.texts import rpt_
from . import bridge as camera_bridge


def collect(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object]) -> list[tuple[bpy.types.Object, Camera]]:
    """The engine's camera of each object, at its photo's size, else the render's. Raises GssmcError, naming the camera."""
    splat = scene.gssmc.splat
    if not objects:
        raise CameraError(rpt_("There is no camera to export; select one, or add a photo first."))
    found = []
    for obj in objects:
        image = photo_image.camera_photo(obj)
        size = tuple(image.size) if image else camera_bridge.lens_frame(scene, obj.data)
        name = Path(bpy.path.abspath(image.filepath or image.name)).name if image else f"{obj.name}.png"
        found.append((obj, replace(camera_bridge.read_camera(scene, obj, splat).at_size(*size), file=name)))
    names = [camera.file for _, camera in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise DatasetError(
            rpt_(
                'Two cameras have the photo "{photo}", by whose name files tell cameras apart; export one of them.', photo=twice
            )
        )
    return found


def out_of_training_world(
    found: Sequence[tuple[bpy.types.Object, Camera]], file: Path
) -> list[tuple[bpy.types.Object, Camera]]:
    """The cameras in the world of the transforms.json that the splat was trained from. Raises GssmcError."""
    world = read_training_world(file).inverse()
    return [(obj, replace(camera, pose=world.pose_to_scene(camera.pose))) for obj, camera in found]


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
        text = rpt_("'{path}' cannot be written ({reason}); choose another place.", path=path, reason=error.strerror)
        raise DatasetError(text) from error


def _record(obj: bpy.types.Object, camera: Camera) -> dict[str, object]:
    note = obj.data.gssmc
    said = {} if note.verdict == "NONE" else {"verdict": note.verdict.lower(), "reasons": note.reasons.splitlines()}
    return {**camera_to_dict(camera), **said}
