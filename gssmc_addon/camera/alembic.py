"""Cameras of Alembic files, which only Blender reads: into a scene of their own that is gone afterwards."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...core.cameras import CameraFile
from ...core.cameras.files import StartCamera
from ...core.errors import CameraError
from ...core.geometry import conventions
from ...core.geometry.camera import Intrinsics
from ..support.texts import rpt_

SUFFIX = ".abc"
# Blender's importer turns the file, whose y points up, so that z does.
FILE_TO_BLENDER = conventions.Similarity.from_matrix(conventions.orientation_matrix("Y_UP"))
NUMBERED = re.compile(r"\.\d{3}$")
HEADER_BYTES, DATA_BIT = 16, 1 << 63
DATA = (
    "objects",
    "cameras",
    "meshes",
    "curves",
    "lights",
    "pointclouds",
    "hair_curves",
    "materials",
    "cache_files",
    "collections",
)


def is_alembic(path: Path) -> bool:
    return path.suffix.lower() == SUFFIX


def is_whole(path: Path) -> bool:
    """Whether all parts of the file lie within it: Blender ends with a crash where one does not.

    The file's container, Ogawa, is a tree: behind "Ogawa" stand 0xff, where the file was finished, two bytes of a version and
    the root's place. A group is a count and as many places, of data where the highest bit is set, and data are a length and
    as many bytes; all numbers of eight bytes.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
        if len(head) < HEADER_BYTES or not head.startswith(b"Ogawa\xff"):
            return False
        waiting, seen = [int.from_bytes(head[8:], "little")], set[int]()
        while waiting:
            at = waiting.pop()
            place, is_data = at & ~DATA_BIT, bool(at & DATA_BIT)
            # Empty groups and data have no place.
            if place == 0 or at in seen:
                continue
            seen.add(at)
            file.seek(place)
            count = int.from_bytes(file.read(8), "little")
            if place + 8 + count * (1 if is_data else 8) > size:
                return False
            if not is_data:
                waiting += np.frombuffer(file.read(8 * count), "<u8").tolist()
    return True


def read(path: Path) -> CameraFile:
    """The file's cameras as they stand at the present frame, in the file's own coordinates. Main thread only.

    Raises CameraError where Blender cannot read it, or it has no camera.
    """
    if not path.is_file() or not is_whole(path):
        raise CameraError(rpt_('"{file}" is no whole Alembic file; export it again.', file=path.name))
    here, before = bpy.context.scene, {kind: set(getattr(bpy.data, kind)) for kind in DATA if hasattr(bpy.data, kind)}
    names = {obj.name for obj in before["objects"]}
    scene = bpy.data.scenes.new(path.stem)
    try:
        scene.frame_set(here.frame_current)
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False, set_frame_range=False)
        scene.view_layers[0].update()
        found = [_start(obj, names) for obj in sorted(scene.objects, key=lambda obj: obj.name) if obj.type == "CAMERA"]
    except RuntimeError:
        raise CameraError(
            rpt_('The Alembic file "{file}" cannot be read by Blender; export it again.', file=path.name)
        ) from None
    finally:
        _remove(scene, before)
    if not found:
        raise CameraError(rpt_('The Alembic file "{file}" holds no camera; export the cameras into it.', file=path.name))
    return CameraFile(tuple(found), count=len(found))


def _remove(scene: bpy.types.Scene, before: dict[str, set[bpy.types.ID]]) -> None:
    bpy.data.scenes.remove(scene)
    bpy.data.batch_remove([one for kind, known in before.items() for one in getattr(bpy.data, kind) if one not in known])


def _start(obj: bpy.types.Object, taken: set[str]) -> StartCamera:
    pose = conventions.pose_from_blender(np.array(obj.matrix_world), FILE_TO_BLENDER)
    # Blender numbers a name that an object of the user has already.
    plain = NUMBERED.sub("", obj.name)
    data = obj.data
    # Of a sensor that stands upright, Blender would take the width for the picture's longer side.
    fit: conventions.SensorFit = "AUTO" if data.sensor_width >= data.sensor_height else "HORIZONTAL"
    lens = conventions.BlenderLens(data.lens, data.sensor_width, data.sensor_height, fit, data.shift_x, data.shift_y)
    return StartCamera(pose, plain if plain in taken else obj.name, lens_of_size=partial(_lens, lens))


def _lens(lens: conventions.BlenderLens, width: int, height: int) -> Intrinsics:
    return conventions.intrinsics_from_blender(lens, width, height)
